"""Links, merges and added colors of a scene's swatches.

Linked swatches have one color; the paint of a merged one changes as much as that of the swatch that moves it.
"""

from collections.abc import Iterable
from dataclasses import replace

import bpy
import numpy as np

from ..engine_api import AddedColor, BadRequest, Surface
from . import colors, displayed, gestures, solving


def link(swatch: bpy.types.PropertyGroup, other: bpy.types.PropertyGroup) -> None:
    """Link two swatches, and all linked to each; they take the color of the other."""
    everyone = [each for item in swatch.id_data.karf.objects for each in item.swatches]
    number = other.link or swatch.link or 1 + max(each.link for each in everyone)
    for each in [*_linked(swatch), *_linked(other)]:
        each.link = number
    other.color = other.color[:]
    gestures.share_surface(*colors.place_of(other))


def unlink(swatch: bpy.types.PropertyGroup) -> None:
    """Unlink a swatch, and the last one otherwise left alone; colors stay."""
    others = [each for each in _linked(swatch) if each != swatch]
    for each in [swatch, *(others if len(others) == 1 else [])]:
        each.link = 0


def _linked(swatch: bpy.types.PropertyGroup) -> list[bpy.types.PropertyGroup]:
    """Return the swatches of a link, or the one alone."""
    items, (item, index) = swatch.id_data.karf.objects, colors.place_of(swatch)
    masks = solving.linked(colors.states(swatch.id_data), item.name, index)
    return [items[name].swatches[number] for name, own in masks.items() for number in np.flatnonzero(own)]


def merge(item: bpy.types.PropertyGroup, index: int, into: int) -> None:
    """Merge a swatch of an object, and those merged into it, into another; it is no longer displayed."""
    unlink(item.swatches[index])
    for number, each in enumerate(item.swatches):
        if number == index or each.merged == index:
            each.merged = into
    item.swatches[into].color = item.swatches[into].color[:]


def split(item: bpy.types.PropertyGroup, index: int) -> None:
    """Separate all swatches merged into one; colors and pictures stay."""
    with gestures.suspended(item.id_data):
        for each in item.swatches:
            if each.merged == index:
                each.merged = 0
                colors.write_surface(each, Surface())  # it has had none while it was merged


def first_set(item: bpy.types.PropertyGroup, color: AddedColor) -> np.ndarray:
    """Return the set [M, 3] of a new added color. Raises BadRequest for black, KarfError without histogram."""
    return solving.first_set(colors.state(item), color, displayed.of(item.id_data).learned_histogram(item.name))


def add_color(
    item: bpy.types.PropertyGroup, color: AddedColor, found: np.ndarray | None = None, is_paint: bool = False
) -> int:
    """Add a color to an object with its set [M, 3], by default as learned; returns its number."""
    count, number = colors.size(item), len(item.swatches)
    with gestures.suspended(item.id_data):
        first = item.swatches.add()
        first.name = f"{'Paint' if is_paint else 'Added'} {number // count}"
        first.is_added, first.is_paint, first.reach, first.protect = True, is_paint, color.reach, color.protect
        first.learned = first.color = color.picked
        for index in range(1, count):
            swatch, own = item.swatches.add(), item.swatches[index]
            swatch.name, swatch.merged = f"{first.name} Set", number
            swatch.learned = swatch.color = own.learned
            swatch.before, swatch.after = own.before, own.after  # then the pigment was the learned swatches' still
        for index, value in enumerate(() if found is None else found, number):
            item.swatches[index].color = value
    return number


def remove_color(item: bpy.types.PropertyGroup, index: int) -> None:
    """Take an added color, whose number is `index`, away with its set."""
    count = colors.size(item)
    for number in reversed(range(index, index + count)):
        item.swatches.remove(number)
    for number in range(index, len(item.swatches)):
        if item.swatches[number].merged:
            item.swatches[number].merged -= count


def replace_added(item: bpy.types.PropertyGroup, wanted: Iterable[AddedColor], even_locked: bool = False) -> np.ndarray:
    """Replace the added colors of an object; paints that are not among them become idle, and come first.

    Return which of its swatches [M] bool are of an edit with the wanted ones. Raises BadRequest if another one is
    locked, unless `even_locked`.
    """
    wanted, state = tuple(wanted), colors.state(item)
    if colors.keys(wanted) == colors.keys(color for color in state.added if color.reach):
        return state.kept
    if not even_locked and any(swatch.is_added and swatch.locked for swatch in item.swatches):
        raise BadRequest("An added color of {name!r} is locked.", "Unlock it in its menu.", name=item.name)
    paints = {
        tuple(state.learned[index]): replace(state.added_color(index), reach=float(state.reach[index]))
        for index in np.flatnonzero(state.is_paint)
    }
    known = {tuple(color.picked): color for color in wanted}
    if paints.keys() & known.keys():
        item.scope = colors.BY_PAINT
    while len(item.swatches) > state.size:
        remove_color(item, state.size)
    idle = [color for picked, color in paints.items() if picked not in known]
    for color in (*idle, *wanted):
        add_color(item, color, is_paint=tuple(color.picked) in paints)
    numbers = np.arange(len(item.swatches))
    return (numbers < state.size) | (numbers >= state.size * (1 + len(idle)))
