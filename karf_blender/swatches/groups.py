"""Swatches that move together: linked ones have one color, merged ones change alike, added ones move their set; locked
ones stay.

A link is a number that any swatches of a scene share. A merged swatch names the one of its object that moves it (its
number, from 1; 0: none): the paint of both then changes by the same amount, so that merging changes no picture. An
added color moves its set (see `colors`), which is solved so that its pigment looks as wanted.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from .. import progress, session
from ..engine_api import MAX_SRGB, AddedColor, BadRequest, KarfError, Surface, match_added_color, mean_weights
from ..host import rendering
from . import colors, keyframes, shown, surfaces

UNREACHED = 0.05  # share of a pigment that added colors reach, up to which it is the learned swatches'


@dataclass
class _State:
    """Whether swatches are being set that no others must follow."""

    is_still: bool = False


@contextmanager
def apart() -> Iterator[None]:
    """Set swatches inside this block without any other following."""
    before, session.get(_State).is_still = session.get(_State).is_still, True
    try:
        yield
    finally:
        session.get(_State).is_still = before


def follow(swatch: bpy.types.PropertyGroup) -> bool:
    """Let the swatches that move with one take its color; whether that was done, and is not itself such a following."""
    if session.get(_State).is_still:
        return False
    with apart():
        for each in together(swatch):
            leader = _leader(each)
            if leader is not None and leader.is_added:
                continue  # one of a set, which is solved as a whole
            if each != swatch and not each.locked:
                each.color = swatch.color if leader is None else _moved_with(leader, each)
            if each.is_added:
                solve_added(each)
    return True


def follow_surface(swatch: bpy.types.PropertyGroup) -> bool:
    """Let the swatches that are linked to one take its surface; as `follow`."""
    if session.get(_State).is_still:
        return False
    with apart():
        for each in linked(swatch):
            if each != swatch and not each.locked:
                surfaces.put(each, surfaces.of(swatch))
    return True


def carry_merged(item: bpy.types.PropertyGroup) -> None:
    """Let an object's merged swatches follow those that they are merged into."""
    with apart():
        for each in item.swatches[: colors.size(item)]:
            if each.merged and not each.locked:
                each.color = _moved_with(item.swatches[each.merged], each)


def place_of(swatch: bpy.types.PropertyGroup) -> tuple[bpy.types.PropertyGroup, int]:
    """A swatch's object, and its number there."""
    item = _object_of(swatch)
    return item, next(index for index, each in enumerate(item.swatches) if each == swatch)


def together(swatch: bpy.types.PropertyGroup) -> list[bpy.types.PropertyGroup]:
    """The swatches that move as one: itself, those linked to it, and behind each the ones merged into it."""
    result = []
    for item in swatch.id_data.karf.objects:
        own = [each == swatch or bool(swatch.link and each.link == swatch.link) for each in item.swatches]
        result += [each for each, is_own in zip(item.swatches, own, strict=True) if is_own]
        result += [each for each in item.swatches if each.merged and own[each.merged]]
    return result


def _leader(swatch: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup | None:
    """The swatch that one is merged into."""
    return _object_of(swatch).swatches[swatch.merged] if swatch.merged else None


def _object_of(swatch: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup:
    (item,) = (item for item in swatch.id_data.karf.objects if any(each == swatch for each in item.swatches))
    return item


def _moved_with(leader: bpy.types.PropertyGroup, swatch: bpy.types.PropertyGroup) -> np.ndarray:
    """The color of a swatch that has changed by as much as the one that moves it."""
    return np.clip(np.add(swatch.learned, np.subtract(leader.color, leader.learned)), 0, MAX_SRGB)


def link(swatch: bpy.types.PropertyGroup, other: bpy.types.PropertyGroup) -> None:
    """Let two swatches, and all that each is linked to, have one color: the other's."""
    everyone = [each for item in swatch.id_data.karf.objects for each in item.swatches]
    number = other.link or swatch.link or 1 + max(each.link for each in everyone)
    for each in [*linked(swatch), *linked(other)]:
        each.link = number
    other.color = other.color[:]
    follow_surface(other)


def unlink(swatch: bpy.types.PropertyGroup) -> None:
    """Let a swatch, and the last one that would be left alone, move by themselves; colors stay."""
    others = [each for each in linked(swatch) if each != swatch]
    for each in [swatch, *(others if len(others) == 1 else [])]:
        each.link = 0


def linked(swatch: bpy.types.PropertyGroup) -> list[bpy.types.PropertyGroup]:
    """The swatches of a link, or the one alone."""
    return [each for each in together(swatch) if not each.merged]


def merge(item: bpy.types.PropertyGroup, index: int, into: int) -> None:
    """Let one swatch of an object move another, which is no longer shown; what that one moved comes along."""
    unlink(item.swatches[index])
    for number, each in enumerate(item.swatches):
        if number == index or each.merged == index:
            each.merged = into
    item.swatches[into].color = item.swatches[into].color[:]


def split(item: bpy.types.PropertyGroup, index: int) -> None:
    """Let all swatches that were merged into one move by themselves again; colors and pictures stay."""
    with apart():
        for each in item.swatches:
            if each.merged == index:
                each.merged = 0
                surfaces.put(each, Surface())  # it has had none while it was merged


def held(item: bpy.types.PropertyGroup) -> list[int]:
    """Numbers of an object's swatches that no solve may move: locked ones, those that others move, and added ones."""
    return [index for index, each in enumerate(item.swatches) if each.locked or each.merged or each.is_added]


def gathered(item: bpy.types.PropertyGroup, weights: np.ndarray) -> np.ndarray:
    """An object's weights [M, ...] with those of merged swatches given to the ones that move them; sets of added colors
    stay as they are."""
    if not any(swatch.merged for swatch in item.swatches):
        return weights
    weights = weights.copy()
    for index, swatch in enumerate(item.swatches[: colors.size(item)]):
        if swatch.merged and not swatch.locked:
            weights[swatch.merged] += weights[index]
            weights[index] = 0
    return weights


# --- added colors --------------------------------------------------------------------------------------------------
def begun_set(item: bpy.types.PropertyGroup, color: AddedColor) -> np.ndarray:
    """The set [M, 3] of a color that is about to be added: what it looks like as the swatches stand, and these swatches, so
    that no picture changes. Where added colors reach its pigment already, it is solved, as it is whenever it moves.

    Raises:
        BadRequest: The color is black, and so has no pigment.
        KarfError: There is no project, or it is damaged or has no such object.
    """
    own, edited = mean_weights(*shown.of(item.id_data).histogram(item), color.picked), colors.edited(item)
    looks = np.clip(color.picked + own @ (edited - colors.learned(item)), 0, 1).astype(np.float32)
    solved, count = solved_set(item, color, looks), colors.size(item)
    return solved if own[count:].sum() > UNREACHED else np.array([looks, *edited[1:count]])


def solved_set(item: bpy.types.PropertyGroup, color: AddedColor, wanted: np.ndarray) -> np.ndarray:
    """The set [M, 3] of an added color with which its pigment looks as wanted, sRGB [3].

    Raises:
        BadRequest: The color is black, and so has no pigment.
        KarfError: There is no project, or it is damaged or has no such object.
    """
    histogram = shown.of(item.id_data).learned_histogram(item.name)
    return match_added_color(histogram, colors.palette(item).colors, color, wanted)


def solve_added(swatch: bpy.types.PropertyGroup) -> None:
    """Let the set of an added color follow it; where it cannot be solved, the set stays and a warning says why."""
    item = _object_of(swatch)
    try:
        found = solved_set(item, colors.added_color(swatch), np.array(swatch.color, np.float32))
    except (KarfError, OSError) as error:
        progress.warn(str(error))
        return
    set_colors(item, next(index for index, each in enumerate(item.swatches) if each == swatch), found)


def set_colors(item: bpy.types.PropertyGroup, index: int, found: np.ndarray) -> None:
    """Give the swatches of a set, the first of which is `index`, these colors [M, 3]."""
    for number, color in enumerate(found, index):
        item.swatches[number].color = color


def add_color(item: bpy.types.PropertyGroup, color: AddedColor) -> int:
    """Add a color with its set to an object, as learned; returns its number."""
    count, number = colors.size(item), len(item.swatches)
    first = item.swatches.add()
    first.name = f"Added {number // count}"
    first.is_added, first.reach, first.protect = True, color.reach, color.protect
    first.learned = first.color = color.picked
    for index in range(1, count):
        swatch, own = item.swatches.add(), item.swatches[index]
        swatch.name, swatch.merged = f"{first.name} Set", number
        swatch.learned = swatch.color = own.learned
        swatch.before, swatch.after = own.before, own.after  # then the pigment was the learned swatches' still
    return number


def remove_color(item: bpy.types.PropertyGroup, index: int) -> None:
    """Take an added color, whose number is `index`, away with its set."""
    count = colors.size(item)
    for number in reversed(range(index, index + count)):
        item.swatches.remove(number)
    for number in range(index, len(item.swatches)):
        if item.swatches[number].merged:
            item.swatches[number].merged -= count


def replace_added(item: bpy.types.PropertyGroup, wanted: Iterable[AddedColor], even_locked: bool = False) -> None:
    """Let an object have these added colors and no others.

    Raises:
        BadRequest: It has others, and one of them is locked, where locked ones are to stay.
    """
    wanted = tuple(wanted)
    if colors.keys(wanted) == colors.keys(colors.added(item)):
        return
    if not even_locked and any(swatch.is_added and swatch.locked for swatch in item.swatches):
        raise BadRequest("An added color of {name!r} is locked.", "Unlock it in its menu.", name=item.name)
    while len(item.swatches) > colors.size(item):
        remove_color(item, colors.size(item))
    for color in wanted:
        add_color(item, color)


# --- keyframes -----------------------------------------------------------------------------------------------------
@session.handler("frame_change_post", phase=session.Phase.SOLVE)
def _after_frame(scene, *_):
    """Keyframes move one swatch without its update; the others of its group follow here."""
    together = any(swatch.link or swatch.merged for item in scene.karf.objects for swatch in item.swatches)
    if not together or rendering.is_running():
        return
    items = {item.name: item for item in scene.karf.objects}
    for curve in keyframes.of(scene):
        if isinstance(curve.swatch, int) and curve.object_name in items:
            swatch = items[curve.object_name].swatches[curve.swatch]
            if curve.tail == ".color":
                follow(swatch)
            elif curve.tail[1:] in surfaces.NUMBERS:
                follow_surface(swatch)
