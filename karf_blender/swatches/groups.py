"""Swatches that move together: linked ones have one color, merged ones change alike; locked ones stay.

A link is a number that any swatches of a scene share. A merged swatch names the one of its object that moves it (its
number, from 1; 0: none): the paint of both then changes by the same amount, so that merging changes no picture. An
added color moves its set, see `pigments`.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..engine_api import BRIGHTEST
from ..host import handlers, rendering
from . import keyframes, pigments


class _Memory:
    """Whether swatches are being set that no others must follow."""

    is_still: bool = False


@contextmanager
def apart() -> Iterator[None]:
    """Set swatches inside this block without any other following."""
    before, _Memory.is_still = _Memory.is_still, True
    try:
        yield
    finally:
        _Memory.is_still = before


def follow(swatch: bpy.types.PropertyGroup) -> bool:
    """Let the swatches that move with one take its color; whether that was done, and is not itself such a following."""
    if _Memory.is_still:
        return False
    with apart():
        for each in together(swatch):
            leader = _leader(each)
            if leader is not None and leader.is_added:
                continue  # one of a set, which is solved as a whole
            if each != swatch and not each.locked:
                each.color = swatch.color if leader is None else _moved_with(leader, each)
            if each.is_added:
                pigments.update(each)
    return True


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
    if not swatch.merged:
        return None
    (item,) = (item for item in swatch.id_data.karf.objects if any(each == swatch for each in item.swatches))
    return item.swatches[swatch.merged]


def _moved_with(leader: bpy.types.PropertyGroup, swatch: bpy.types.PropertyGroup) -> np.ndarray:
    """The color of a swatch that has changed by as much as the one that moves it."""
    return np.clip(np.add(swatch.learned, np.subtract(leader.color, leader.learned)), 0, BRIGHTEST)


def link(swatch: bpy.types.PropertyGroup, other: bpy.types.PropertyGroup) -> None:
    """Let two swatches, and all that each is linked to, have one color: the other's."""
    everyone = [each for item in swatch.id_data.karf.objects for each in item.swatches]
    number = other.link or swatch.link or 1 + max(each.link for each in everyone)
    for each in [*linked(swatch), *linked(other)]:
        each.link = number
    other.color = other.color[:]


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
    """Let all swatches that were merged into one move by themselves again; colors stay."""
    for each in item.swatches:
        if each.merged == index:
            each.merged = 0


def held(item: bpy.types.PropertyGroup) -> list[int]:
    """Numbers of an object's swatches that no solve may move: locked ones, those that others move, and added ones."""
    return [index for index, each in enumerate(item.swatches) if each.locked or each.merged or each.is_added]


def gathered(item: bpy.types.PropertyGroup, weights: np.ndarray) -> np.ndarray:
    """An object's weights [M, ...] with those of merged swatches given to the ones that move them; sets of added colors
    stay as they are."""
    if not any(swatch.merged for swatch in item.swatches):
        return weights
    weights = weights.copy()
    for index, swatch in enumerate(item.swatches[: pigments.size(item)]):
        if swatch.merged and not swatch.locked:
            weights[swatch.merged] += weights[index]
            weights[index] = 0
    return weights


@persistent
def _after_frame(scene, *_):
    """Keyframes move one swatch without its update; the others of its group follow here."""
    together = any(swatch.link or swatch.merged for item in scene.karf.objects for swatch in item.swatches)
    if not together or rendering.is_running():
        return
    items = {item.name: item for item in scene.karf.objects}
    for curve in keyframes.of(scene):
        if isinstance(curve.swatch, int) and curve.tail == ".color" and curve.object_name in items:
            follow(items[curve.object_name].swatches[curve.swatch])


HANDLERS = (("frame_change_post", _after_frame),)


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
