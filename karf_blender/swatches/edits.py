"""Edits: the swatches of a scene as an edit, and back, and what tools do to them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ..engine_api import (
    BadRequest,
    EdgeShape,
    Edit,
    Surface,
    color_to_text,
    colors_of_text,
    edit_to_json,
    rgb_to_hex,
    wanted_color,
)
from . import colors, displayed, gestures, groups, solving
from .solving import Becoming

MOST_HELD = 8  # pairs held for an object's paints

Edited = Callable[[bpy.types.PropertyGroup], np.ndarray]  # an object's palette, [M, 3]


def current_edit(scene: bpy.types.Scene, edited: Edited = colors.edited) -> Edit:
    """Return the current edit of the scene, with the palettes that `edited` returns."""
    palettes = {item.name: edited(item)[colors.state(item).kept] for item in scene.karf.objects}
    return Edit(palettes, scene.karf.compositing, colors.added_by_object(scene), colors.edges(scene))


def edit_option(scene: bpy.types.Scene, edited: Edited = colors.edited) -> dict[str, Any] | None:
    """Return the same for a query, as edit.json; None before there are palettes."""
    return edit_to_json(current_edit(scene, edited)) if len(scene.karf.objects) else None


def apply_edit(scene: bpy.types.Scene, edit: Edit, is_whole: bool = False) -> None:
    """Set the swatches, edges and added colors to an edit of these objects.

    Other objects and locked swatches stay, merged ones follow; an edit that is a whole state (`is_whole`) sets all.
    Surfaces become neutral: the colors of an edit contain them.
    """
    rows = {}
    with displayed.batched(scene), gestures.suspended(scene):
        scene.karf.compositing = edit.compositing
        for name in edit.colors:
            item = object_named(scene, name)
            _bake_surfaces(item)
            rows[name] = groups.replace_added(item, edit.added.get(name, ()), even_locked=is_whole)
            shape = edit.edges.get(name, EdgeShape())
            item.choke, item.feather = shape.choke, shape.feather
        states = colors.states(scene)
        for name, given in edit.colors.items():
            state = states[name]
            wanted = state.chosen.copy()
            wanted[rows[name]] = given
            if is_whole:
                states[name] = state.with_colors(wanted)
                continue
            for index in np.flatnonzero(rows[name] & ~state.locked & (state.merged == 0)):
                states = solving.assign(states, name, index, wanted[index])
                states = gestures.solve_sets(scene, states, name, index)
        gestures.write(scene, states)


def _bake_surfaces(item: bpy.types.PropertyGroup) -> None:
    """Give an object's swatches the displayed colors, and neutral surfaces."""
    state = colors.state(item)
    if not state.is_neutral:
        colors.write(item, state.edited)
        colors.write(item, np.zeros_like(state.shift), "shift")
        for swatch in item.swatches:
            colors.write_surface(swatch, Surface())


def set_color(scene: bpy.types.Scene, name: str, index: int, color: Sequence[float] | np.ndarray) -> None:
    """Set one swatch of an object, counted from 1. Raises BadRequest for a locked one."""
    unlocked(scene, name, index).color = color


def reset(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Reset one swatch of an object (None: all), and those that moved with it, as learned; locked ones stay."""
    item = object_named(scene, name)
    if index is not None:
        unlocked(scene, name, index)
    with displayed.batched(scene), gestures.suspended(scene):
        for number in range(len(item.swatches)) if index is None else [index]:
            for each, own in gestures.reset(item, number, follows=index is not None).items():
                for place in np.flatnonzero(own):
                    colors.write_surface(scene.karf.objects[each].swatches[place], Surface())


def reset_surface(scene: bpy.types.Scene, name: str, index: int | None = None) -> None:
    """Reset the surface of one swatch of an object (None: all) and those linked to it; locked ones stay."""
    chosen = object_named(scene, name).swatches if index is None else [unlocked(scene, name, index)]
    with displayed.batched(scene):
        for swatch in chosen:
            if not swatch.locked:
                colors.write_surface(swatch, Surface())


def swap(scene: bpy.types.Scene, first: tuple[str, int], second: tuple[str, int]) -> None:
    """Exchange the colors of two swatches, each an object's name and a number."""
    one, other = unlocked(scene, *first), unlocked(scene, *second)
    with displayed.batched(scene):
        one.color, other.color = other.color[:], one.color[:]


def paste(scene: bpy.types.Scene, name: str, index: int | None, text: str) -> None:
    """Set one swatch (None: all in order) to the colors in a text. Raises BadRequest without any, or if it is locked."""
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
        item = object_named(scene, name)
        for number, color in zip(colors.offered(item), found, strict=False):
            swatch = item.swatches[number]
            if not swatch.locked:
                swatch.color = color


def copied(scene: bpy.types.Scene, name: str, index: int | None) -> str:
    """Return the color of one swatch of an object (None: of all displayed ones) as a text."""
    item = object_named(scene, name)
    swatches = [item.swatches[number] for number in colors.offered(item)]
    if index is not None:
        swatches = [swatch_at(scene, name, index)]
    return " ".join(color_to_text(swatch.color) for swatch in swatches)


def unlocked(scene: bpy.types.Scene, name: str, index: int) -> bpy.types.PropertyGroup:
    """Return a swatch of an object that may be changed. Raises BadRequest if it is locked, merged or `swatch_at` does."""
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
    """Return the scene's object with this name. Raises BadRequest without one."""
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
    """Return a swatch of an object. Raises BadRequest if there is none, or for the frozen black."""
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


# --- one color becomes another -------------------------------------------------------------------------------------
def become(item: bpy.types.PropertyGroup, pair: Becoming) -> str:
    """Make one color of an object another; return why not, if so. Raises KarfError without such a color or histogram."""
    scene, state = item.id_data, colors.state(item)
    if pair.rule == "paint":
        _become_paint(item, pair)
        return ""
    wanted, missed = solving.become(state, pair, displayed.of(scene).histogram(state))
    edit = Edit(
        {item.name: wanted[state.kept]}, scene.karf.compositing, colors.added_by_object(scene), colors.edges(scene)
    )
    apply_edit(scene, edit)
    return missed


def _become_paint(item: bpy.types.PropertyGroup, pair: Becoming) -> None:
    """Make one color of an object another by its paint alone, which is added if there is none."""
    scene, state, shown = item.id_data, colors.state(item), displayed.of(item.id_data)
    seen = shown.learned_histogram(item.name)
    source = solving.learned_source(state, pair, shown.histogram(state))
    number, color = solving.paint_at(state, seen, source)
    with displayed.batched(scene):
        number = number or groups.add_color(item, color, groups.first_set(item, color))
        wanted = wanted_color(seen, state.palette.colors, color, source, pair.target)
        set_color(scene, item.name, number, wanted)


def become_target(item: bpy.types.PropertyGroup) -> str:
    """`become` with the object's own pair of colors, from the swatches as they were when its source was picked.

    Other changes made since are kept as the start, unless they have taken the source itself away.
    """
    state, pair = colors.state(item), colors.becoming(item)
    if (state.edited != colors.stored(item, "after")).any():
        histogram = displayed.of(item.id_data).histogram(state)
        if solving.is_shown(state.visible(histogram, state.edited), histogram.counts, pair.source):
            pair = replace(pair, start=state.edited)
    missed = become(item, pair)
    _remember_pair(item, pair.start, colors.edited(item))
    return missed


def source_picked(item: bpy.types.PropertyGroup) -> None:
    """Remember swatches and exposure where the source was just picked; hold an applied target from now on."""
    before, after, now = colors.stored(item, "before"), colors.stored(item, "after"), colors.edited(item)
    if (before != after).any() and (after == now).all():
        given = [*colors.held(item), np.array(item.target)][-MOST_HELD:]
        item.held = " ".join(map(rgb_to_hex, given))
    item.gains = displayed.of(item.id_data).gains
    _remember_pair(item, now, now)


def _remember_pair(item: bpy.types.PropertyGroup, before: np.ndarray, after: np.ndarray) -> None:
    item.swatches.foreach_set("before", before.ravel())
    item.swatches.foreach_set("after", after.ravel())
