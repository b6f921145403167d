"""What an extension has put into Blender: handlers, timers, drawing callbacks, classes, properties. Runs inside Blender."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from types import FunctionType

import bpy

DRAWN_AT = ("PRE_VIEW", "POST_VIEW", "POST_PIXEL", "BACKDROP")
OWNERS = (bpy.types.Scene, bpy.types.WindowManager, bpy.types.Object, bpy.types.Image)
BASES = "Panel Operator Menu Header UIList PropertyGroup AddonPreferences FileHandler Gizmo GizmoGroup".split()


def remains(package: str) -> list[str]:
    """All that Blender still holds of a package, a line each; empty after it was disabled."""
    functions = list(_functions(package))
    return sorted(
        {
            *_handlers(package),
            *(f"timer {each.__name__}" for each in functions if bpy.app.timers.is_registered(each)),
            *(f"drawing {each.__name__}" for each in _drawn(functions)),
            *_classes(package),
            *_properties(package),
        }
    )


def _functions(package: str) -> Iterator[FunctionType]:
    """The functions of the package's modules; these stay in memory when an extension is disabled."""
    for name, module in list(sys.modules.items()):
        if name == package or name.startswith(f"{package}."):
            yield from (each for each in vars(module).values() if isinstance(each, FunctionType))


def _handlers(package: str) -> Iterator[str]:
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        if isinstance(handlers, list):
            yield from (f"handler {name} {each.__name__}" for each in handlers if _is_of(each, package))


def _drawn(functions: list[FunctionType]) -> Iterator[FunctionType]:
    """Blender has no list of drawing callbacks, but it keeps the arguments of `draw_handler_add` as they were given."""
    for each in gc.get_objects():
        if type(each) is tuple and len(each) > 3 and isinstance(each[-1], str) and each[-1] in DRAWN_AT:
            yield from (function for function in functions if any(function is one for one in each))


def _classes(package: str) -> Iterator[str]:
    for base in BASES:
        for each in getattr(bpy.types, base).__subclasses__():
            if _is_of(each, package) and "bl_rna" in vars(each):  # a gizmo has no is_registered
                yield f"class {each.__name__}"


def _properties(package: str) -> Iterator[str]:
    prefix = package.rpartition(".")[2]
    for owner in OWNERS:
        yield from (
            f"property {owner.__name__}.{each.identifier}"
            for each in owner.bl_rna.properties
            if each.identifier.startswith(prefix)
        )


def _is_of(thing: object, package: str) -> bool:
    module = getattr(thing, "__module__", "") or ""
    return module == package or module.startswith(f"{package}.")
