"""How far an object's color is from the one that it was to become, in CIEDE2000, as its swatches stand.

A wish is the pair of colors of *One color becomes another*. Numbers are taken when something changes; drawing only asks
for them.
"""

import bpy
import numpy as np

from ..engine_api import KarfError, Palette, ciede2000, reached_color, shown_colors, srgb_to_lab
from . import colors, pigments


class _Memory:
    """Of each wish by scene and object what it depends on, and the difference."""

    left: dict[tuple[int, str], tuple[tuple, float]] = {}


def left(scene: bpy.types.Scene, item: bpy.types.PropertyGroup) -> float | None:
    """CIEDE2000 of what the object's source color has become to its target; None where there is no target color."""
    known = _Memory.left.get((scene.session_uid, item.name))
    return known[1] if known and known[0][:2] == _wish(item) else None


def update(scene: bpy.types.Scene) -> None:
    """Take the differences anew where swatches or wishes have changed; never raises."""
    for item in scene.karf.objects:
        place = scene.session_uid, item.name
        if tuple(item.source) == tuple(item.target):
            _Memory.left.pop(place, None)
            continue
        palettes = colors.edited(item).tobytes(), colors.picked_with(item).tobytes()
        key = (*_wish(item), scene.karf.project, *palettes)
        if place not in _Memory.left or _Memory.left[place][0] != key:
            try:
                _Memory.left[place] = key, _difference(item)
            except (KarfError, OSError):  # the project is gone, or has no such object yet
                _Memory.left.pop(place, None)


def forget() -> None:
    """Drop what is in memory."""
    _Memory.left.clear()


def _wish(item: bpy.types.PropertyGroup) -> tuple:
    return tuple(item.source), tuple(item.target)


def _difference(item: bpy.types.PropertyGroup) -> float:
    seen, learned = pigments.seen(item), Palette(item.name, colors.learned(item))
    before = shown_colors(seen, learned, colors.picked_with(item))
    after = shown_colors(seen, learned, colors.edited(item))
    reached = reached_color(before, after, np.array(item.source), seen.counts)
    return float(ciede2000(srgb_to_lab(reached), srgb_to_lab(np.array(item.target))))
