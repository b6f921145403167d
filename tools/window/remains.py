"""List an extension's handlers, timers, drawing callbacks, classes and properties. Runs inside Blender."""

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
    """Return everything of a package that Blender still holds, a line each; empty after it was disabled."""
    return sorted({*_functions(package), *_handlers(package), *_classes(package), *_properties(package)})


def _functions(package: str) -> Iterator[str]:
    """Timers and drawing callbacks among the functions of the package's modules, which stay in memory."""
    modules = [module for name, module in list(sys.modules.items()) if f"{name}.".startswith(f"{package}.")]
    functions = [each for module in modules for each in vars(module).values() if isinstance(each, FunctionType)]
    yield from (f"timer {each.__name__}" for each in functions if bpy.app.timers.is_registered(each))
    # Blender has no list of drawing callbacks, but it keeps the arguments of `draw_handler_add` as they were given
    for given in gc.get_objects():
        if type(given) is tuple and len(given) > 3 and isinstance(given[-1], str) and given[-1] in DRAWN_AT:
            yield from (f"drawing {each.__name__}" for each in functions if any(each is one for one in given))


def _handlers(package: str) -> Iterator[str]:
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        if isinstance(handlers, list):
            yield from (f"handler {name} {each.__name__}" for each in handlers if _is_of(each, package))


def _classes(package: str) -> Iterator[str]:
    for base in BASES:
        for each in getattr(bpy.types, base).__subclasses__():
            if _is_of(each, package) and "bl_rna" in vars(each):  # a gizmo has no is_registered
                yield f"class {each.__name__}"


def _properties(package: str) -> Iterator[str]:
    prefix = package.rpartition(".")[2]
    for owner in OWNERS:
        names = [each.identifier for each in owner.bl_rna.properties if each.identifier.startswith(prefix)]
        yield from (f"property {owner.__name__}.{name}" for name in names)


def _is_of(thing: object, package: str) -> bool:
    return f"{getattr(thing, '__module__', '') or ''}.".startswith(f"{package}.")
