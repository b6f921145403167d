"""Saturation, brightness and gloss of swatches: what they add to the colors that were chosen.

The artist's colors and numbers stay as they are; the palette that is shown is solved of both anew, so that a number can be
moved to and fro. What is solved is kept in the scene as each swatch's `shift`, where drivers of node trees find it, and
where a file that is opened without its project has it still.
"""

from collections.abc import Callable

import bpy
import numpy as np

from ..engine_api import MAX_SRGB, ColorHistogram, KarfError, Palette, Surface, match_surface, shown_colors
from . import colors

NUMBERS = ("saturation", "brightness", "gloss")
Histogram = Callable[[bpy.types.PropertyGroup], ColorHistogram]  # of an object, with the sets of its added colors


def of(swatch: bpy.types.PropertyGroup) -> Surface:
    """The surface of a swatch; one that another moves has none of its own."""
    return Surface() if swatch.merged else Surface(*_numbers(swatch))


def _numbers(swatch: bpy.types.PropertyGroup) -> tuple[float, ...]:
    return tuple(getattr(swatch, name) for name in NUMBERS)


def is_neutral(item: bpy.types.PropertyGroup) -> bool:
    """Whether no swatch of an object has a surface."""
    return all(of(swatch).is_neutral for swatch in item.swatches)


def put(swatch: bpy.types.PropertyGroup, surface: Surface) -> None:
    """Give a swatch a surface."""
    for name in NUMBERS:
        if getattr(swatch, name) != getattr(surface, name):
            setattr(swatch, name, getattr(surface, name))


def bake(item: bpy.types.PropertyGroup) -> None:
    """Let an object's swatches have the colors that they are shown with, and neutral surfaces."""
    if is_neutral(item):
        return
    for swatch, color in zip(item.swatches, colors.edited(item), strict=True):
        swatch.color, swatch.shift = color, (0, 0, 0)
        put(swatch, Surface())


def update(scene: bpy.types.Scene, histogram_of: Histogram, known: dict[str, tuple]) -> None:
    """Bring the shifts of a scene's swatches up to date; those of an object whose colors nobody has counted stay.

    Args:
        scene: The scene.
        histogram_of: The colors of an object.
        known: What each object's shifts were found of, by its name; it is brought up to date.
    """
    for item in scene.karf.objects:
        if known.get(item.name) == _inputs(item):
            continue
        try:
            _put_shifts(item, _solved(item, histogram_of))
        except (KarfError, OSError):
            continue
        known[item.name] = _inputs(item)


def solved(item: bpy.types.PropertyGroup, histogram_of: Histogram) -> np.ndarray:
    """As `colors.edited`, with what surfaces add found anew and not kept: while Blender renders nothing can be put into the
    scene, and keyframed numbers move on. Where nobody has counted the object's colors, as they were kept."""
    try:
        return np.clip(colors.chosen(item) + _solved(item, histogram_of), 0, MAX_SRGB)
    except (KarfError, OSError):
        return colors.edited(item)


def _inputs(item: bpy.types.PropertyGroup) -> tuple:
    """All that an object's shifts are found of, and the shifts."""
    arrays = (colors.stored(item, name).tobytes() for name in ("learned", "color", "shift"))
    rest = (
        (*_numbers(each), each.locked, each.merged, each.is_added, each.reach, each.protect) for each in item.swatches
    )
    return *arrays, *rest


def _put_shifts(item: bpy.types.PropertyGroup, shifts: np.ndarray) -> None:
    for swatch, before, shift in zip(item.swatches, colors.stored(item, "shift"), shifts, strict=True):
        if (before != shift).any():
            swatch.shift = shift


def _solved(item: bpy.types.PropertyGroup, histogram_of: Histogram) -> np.ndarray:
    """What the surfaces of an object's swatches add to its chosen colors, [M, 3]: its learned swatches', and each set's."""
    chosen, kept = colors.chosen(item), _kept(item)
    if is_neutral(item):
        return kept
    seen, numbers, size = histogram_of(item), np.arange(len(chosen)), colors.size(item)
    if seen.palette_weights.shape[1] != len(chosen):  # the project has learned others since
        return colors.stored(item, "shift")
    visible = shown_colors(seen, Palette(item.name, colors.learned(item)), chosen)
    shifts = np.zeros_like(chosen)
    for first in range(0, len(chosen), size):
        is_own = (numbers >= first) & (numbers < first + size)
        surfaces = {index: of(item.swatches[index]) for index in numbers[is_own].tolist()}
        pinned = [*numbers[~is_own], *(index for index in surfaces if _is_held(item.swatches[index]))]
        own = kept * is_own[:, None]
        shifts += match_surface(visible, seen.counts, seen.palette_weights, chosen, surfaces, pinned, own) - chosen
    return shifts


def _is_held(swatch: bpy.types.PropertyGroup) -> bool:
    """Whether surfaces of others must not move a swatch: it is locked, and has none of its own."""
    return swatch.locked and of(swatch).is_neutral


def _kept(item: bpy.types.PropertyGroup) -> np.ndarray:
    """What surfaces have added to swatches before they were locked, [M, 3]: these stay as they are shown."""
    is_held = np.array([_is_held(swatch) for swatch in item.swatches], bool)
    return np.where(is_held[:, None], colors.stored(item, "shift"), np.float32(0))
