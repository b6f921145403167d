"""Swatches of a scene as palettes and edits, and back.

Swatch 0 of every object is black, frozen and not shown. Colors are sRGB numbers in float32, as Blender stores them, so
a swatch never touched equals its learned color exactly.
"""

from collections.abc import Sequence

import bpy
import numpy as np

from ..engine_api import BadRequest, Edit, Palette
from . import colors, recolor


def learned(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """The palettes as learned."""
    return tuple(Palette(item.name, colors.learned(item)) for item in scene.karf.objects)


def current_edit(scene: bpy.types.Scene) -> Edit:
    """The palettes as the swatches stand now."""
    return Edit({item.name: colors.edited(item) for item in scene.karf.objects}, scene.karf.compositing)


def apply_edit(scene: bpy.types.Scene, edit: Edit) -> None:
    """Set the swatches to an edit of these objects; objects that it leaves out stay as they are."""
    with recolor.batched(scene):
        scene.karf.compositing = edit.compositing
        for name, wanted in edit.colors.items():
            for swatch, color in zip(object_named(scene, name).swatches, wanted, strict=True):
                swatch.color = color


def set_color(scene: bpy.types.Scene, name: str, index: int, color: Sequence[float] | np.ndarray) -> None:
    """Set one swatch of an object; index counts from 1, since swatch 0 is black."""
    swatch_at(scene, name, index).color = color


def reset(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Give one swatch of an object (None: all) its learned color back."""
    chosen = object_named(scene, name).swatches if index is None else [swatch_at(scene, name, index)]
    with recolor.batched(scene):
        for swatch in chosen:
            swatch.color = swatch.learned


def object_named(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """The scene's object with this name.

    Raises:
        BadRequest: There is none; the hint lists those there are.
    """
    item = scene.karf.objects.get(name)
    if item is None:
        known = ", ".join(scene.karf.objects.keys())
        raise BadRequest(
            f"The scene has no object {name!r}.", f"Objects: {known}." if known else "Extract the palettes first."
        )
    return item


def swatch_at(scene: bpy.types.Scene, name: str, index: int) -> bpy.types.PropertyGroup:
    """Swatch `index` of an object.

    Raises:
        BadRequest: There is none, or it is the frozen black.
    """
    found = object_named(scene, name).swatches
    if not 1 <= index < len(found):
        raise BadRequest(
            f"Object {name!r} has no swatch {index}.", f"Swatches count from 1 to {len(found) - 1}; black is frozen."
        )
    return found[index]
