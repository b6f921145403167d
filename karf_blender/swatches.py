"""Swatches of a scene as palettes and edits, and back.

Swatch 0 of every object is black, frozen and not shown. Colors are sRGB numbers in float32, as Blender stores them, so
a swatch never touched equals its learned color exactly.
"""

from collections.abc import Sequence

import bpy
import numpy as np

from . import folders, recolor
from .engine_api import BadRequest, Edit, KarfError, Palette, read_palettes


def load_palettes(scene: bpy.types.Scene, palettes: Sequence[Palette]) -> None:
    """Replace the scene's objects and swatches by these learned palettes; edits are given up."""
    with recolor.held(scene):
        scene.karf.objects.clear()
        for palette in palettes:
            item = scene.karf.objects.add()
            item.name = palette.name
            for index, color in enumerate(palette.colors):
                swatch = item.swatches.add()
                swatch.name = f"Color {index}" if index else "Black"
                swatch.learned = swatch.color = color
                swatch.locked = index == 0
            item.source = item.target = palette.colors[min(1, len(palette.colors) - 1)]


def take_over(scene: bpy.types.Scene) -> None:
    """Bring what the scene's project has learned: its masks, and its palettes where the scene has others.

    Edits of the same palettes are kept.
    """
    if not scene.karf.project:
        return
    project = folders.project_of(scene)
    if not scene.karf.masks and project.masks_folder.is_dir():
        scene.karf.masks = folders.stored(project.masks_folder)
    try:
        palettes = read_palettes(project.palette_file)
    except KarfError:  # nothing was learned yet
        return
    if [_key(palette) for palette in palettes] != [_key(palette) for palette in learned(scene)]:
        recolor.forget()
        load_palettes(scene, palettes)


def _key(palette: Palette) -> tuple[str, bytes]:
    return palette.name, palette.colors.astype(np.float32).tobytes()


def learned(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """The palettes as learned."""
    return tuple(Palette(item.name, recolor.learned_colors(item)) for item in scene.karf.objects)


def current_edit(scene: bpy.types.Scene) -> Edit:
    """The palettes as the swatches stand now."""
    colors = {item.name: recolor.edited_colors(item) for item in scene.karf.objects}
    return Edit(colors, scene.karf.compositing)


def apply_edit(scene: bpy.types.Scene, edit: Edit) -> None:
    """Set the swatches to an edit of these objects; objects that it leaves out stay as they are."""
    with recolor.held(scene):
        scene.karf.compositing = edit.compositing
        for name, colors in edit.colors.items():
            for swatch, color in zip(object_named(scene, name).swatches, colors, strict=True):
                swatch.color = color


def set_color(scene: bpy.types.Scene, name: str, index: int, color: Sequence[float] | np.ndarray) -> None:
    """Set one swatch of an object; index counts from 1, since swatch 0 is black."""
    swatch_at(scene, name, index).color = color


def reset(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Give one swatch of an object (None: all) its learned color back."""
    chosen = object_named(scene, name).swatches if index is None else [swatch_at(scene, name, index)]
    with recolor.held(scene):
        for swatch in chosen:
            swatch.color = swatch.learned


def object_named(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """The scene's object with this name. Raises BadRequest listing those there are."""
    item = scene.karf.objects.get(name)
    if item is None:
        known = ", ".join(scene.karf.objects.keys())
        raise BadRequest(
            f"The scene has no object {name!r}.", f"Objects: {known}." if known else "Extract the palettes first."
        )
    return item


def swatch_at(scene: bpy.types.Scene, name: str, index: int) -> bpy.types.PropertyGroup:
    """Swatch `index` of an object. Raises BadRequest where there is none, or where it is the frozen black."""
    found = object_named(scene, name).swatches
    if not 1 <= index < len(found):
        raise BadRequest(
            f"Object {name!r} has no swatch {index}.", f"Swatches count from 1 to {len(found) - 1}; black is frozen."
        )
    return found[index]
