"""Swatches of a scene as palettes and edits, and back.

Swatch 0 of every object is black, frozen and not shown. Colors are sRGB numbers in float32, as Blender stores them, so
a swatch never touched equals its learned color exactly.
"""

from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np

from ..engine_api import BadRequest, EdgeShape, Edit, Surface, color_to_text, colors_of_text, edit_to_json
from . import colors, displayed, gestures, groups, solving

Edited = Callable[[bpy.types.PropertyGroup], np.ndarray]  # an object's palette, [M, 3]


def current_edit(scene: bpy.types.Scene, edited: Edited = colors.edited) -> Edit:
    """Return the palettes as the swatches stand now, each as `edited` says."""
    palettes = {item.name: edited(item) for item in scene.karf.objects}
    return Edit(palettes, scene.karf.compositing, colors.added_by_object(scene), colors.edges(scene))


def edit_option(scene: bpy.types.Scene, edited: Edited = colors.edited) -> dict[str, Any] | None:
    """Return the same for a query, as edit.json; None before there are palettes."""
    return edit_to_json(current_edit(scene, edited)) if len(scene.karf.objects) else None


def apply_edit(scene: bpy.types.Scene, edit: Edit, is_whole: bool = False) -> None:
    """Set the swatches and edges to an edit of these objects, added colors among them.

    Objects that it leaves out and locked swatches stay, merged ones follow; where the edit is a whole state, all are set to
    what it says. Surfaces are part of its colors, and become neutral.
    """
    with displayed.batched(scene), gestures.suspended(scene):
        scene.karf.compositing = edit.compositing
        for name in edit.colors:
            item = object_named(scene, name)
            _bake_surfaces(item)
            groups.replace_added(item, edit.added.get(name, ()), even_locked=is_whole)
            shape = edit.edges.get(name, EdgeShape())
            item.choke, item.feather = shape.choke, shape.feather
        states = colors.states(scene)
        for name, wanted in edit.colors.items():
            state = states[name]
            if is_whole:
                states[name] = state.with_colors(wanted)
                continue
            for index in np.flatnonzero(~state.locked & (state.merged == 0)):
                states = solving.assign(states, name, index, wanted[index])
                states = gestures.solve_sets(scene, states, name, index)
        gestures.write(scene, states)


def _bake_surfaces(item: bpy.types.PropertyGroup) -> None:
    """Let an object's swatches have the colors that they are shown with, and neutral surfaces."""
    state = colors.state(item)
    if not state.is_neutral:
        colors.write(item, state.edited)
        colors.write(item, np.zeros_like(state.shift), "shift")
        for swatch in item.swatches:
            colors.write_surface(swatch, Surface())


def set_color(scene: bpy.types.Scene, name: str, index: int, color: Sequence[float] | np.ndarray) -> None:
    """Set one swatch of an object; index counts from 1, since swatch 0 is black. Raises BadRequest for a locked one."""
    unlocked(scene, name, index).color = color


def reset(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Give one swatch of an object (None: all) the learned color and surface back, and those that move with it theirs.

    What followed a swatch that was dragged follows it back; locked ones stay.
    """
    item = object_named(scene, name)
    if index is not None:
        unlocked(scene, name, index)
    with displayed.batched(scene), gestures.suspended(scene):
        for number in range(len(item.swatches)) if index is None else [index]:
            for each, own in gestures.reset(item, number, follows=index is not None).items():
                for place in np.flatnonzero(own):
                    colors.write_surface(scene.karf.objects[each].swatches[place], Surface())


def reset_surface(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Give one swatch of an object (None: all) and those linked to it a neutral surface; locked ones stay."""
    chosen = object_named(scene, name).swatches if index is None else [unlocked(scene, name, index)]
    with displayed.batched(scene):
        for swatch in chosen:
            if not swatch.locked:
                colors.write_surface(swatch, Surface())


def swap(scene: bpy.types.Scene, first: tuple[str, int], second: tuple[str, int]) -> None:
    """Let two swatches, each an object's name and a number, exchange their colors."""
    one, other = unlocked(scene, *first), unlocked(scene, *second)
    with displayed.batched(scene):
        one.color, other.color = other.color[:], one.color[:]


def paste(scene: bpy.types.Scene, name: str, index: int | None, text: str) -> None:
    """Set one swatch of an object (None: its swatches in their order) to the colors that a text names.

    Raises:
        BadRequest: The text names none, or the swatch is locked.
    """
    found = colors_of_text(text)
    if not len(found):
        raise BadRequest(
            "The clipboard contains no color.",
            "Copy one color as #rrggbb, or several with any separators for all swatches.",
        )
    if index is not None:
        set_color(scene, name, index, found[0])
        return
    with displayed.batched(scene):
        shown = [swatch for swatch in object_named(scene, name).swatches[1:] if not swatch.merged]
        for swatch, color in zip(shown, found, strict=False):
            if not swatch.locked:
                swatch.color = color


def copied(scene: bpy.types.Scene, name: str, index: int | None) -> str:
    """The color of one swatch of an object (None: of all that are shown) as a text."""
    swatches = object_named(scene, name).swatches[1:] if index is None else [swatch_at(scene, name, index)]
    return " ".join(color_to_text(swatch.color) for swatch in swatches if not swatch.merged)


def unlocked(scene: bpy.types.Scene, name: str, index: int) -> bpy.types.PropertyGroup:
    """Swatch `index` of an object, which may be changed.

    Raises:
        BadRequest: There is none, or it is the frozen black, locked, or moved by another.
    """
    swatch = swatch_at(scene, name, index)
    if swatch.merged:
        raise BadRequest(
            "Swatch {index} of {name!r} is merged into {merged}.",
            "Split that swatch in its menu.",
            index=index,
            name=name,
            merged=swatch.merged,
        )
    if swatch.locked:
        raise BadRequest("Swatch {index} of {name!r} is locked.", "Unlock it in its menu.", index=index, name=name)
    return swatch


def object_named(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """The scene's object with this name.

    Raises:
        BadRequest: There is none; the hint lists those there are.
    """
    item = scene.karf.objects.get(name)
    if item is None:
        known = ", ".join(scene.karf.objects.keys())
        raise BadRequest(
            "The scene has no object {name!r}.",
            "Objects: {known}." if known else "Extract the palettes first.",
            name=name,
            known=known,
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
            "Object {name!r} has no swatch {index}.",
            "Swatches are numbered from 1 to {count}; black is fixed.",
            name=name,
            index=index,
            count=len(found) - 1,
        )
    return found[index]
