"""How far an object's color is from the one that it was to become, in CIEDE2000, as its swatches stand.

A wish is the pair of colors of *One color becomes another*. Numbers are taken when something changes; drawing only asks
for them.
"""

from pathlib import Path

import bpy
import numpy as np

from ..engine_api import (
    ColorHistogram,
    KarfError,
    Palette,
    ciede2000,
    reached_color,
    read_object_colors,
    shown_colors,
    srgb_to_lab,
)
from ..project import folders
from . import colors


class _Memory:
    """The objects' colors by their file, its time and the object; of each wish by scene and object what it depends on,
    and the difference."""

    seen: dict[tuple[Path, int, str], ColorHistogram] = {}
    left: dict[tuple[int, str], tuple[tuple, float]] = {}


def left(scene: bpy.types.Scene, item: bpy.types.PropertyGroup) -> float | None:
    """CIEDE2000 of what the object's source color has become to its target; None where there is no wish."""
    known = _Memory.left.get((scene.session_uid, item.name))
    return known[1] if known and known[0][:2] == _wish(item) else None


def update(scene: bpy.types.Scene) -> None:
    """Take the differences anew where swatches or wishes have changed; never raises."""
    for item in scene.karf.objects:
        place = scene.session_uid, item.name
        if tuple(item.source) == tuple(item.target):
            _Memory.left.pop(place, None)
            continue
        key = (*_wish(item), scene.karf.project, picked_on(item).tobytes(), colors.edited(item).tobytes())
        if place not in _Memory.left or _Memory.left[place][0] != key:
            try:
                _Memory.left[place] = key, _difference(scene, item)
            except (KarfError, OSError):  # the project is gone, or has no such object yet
                _Memory.left.pop(place, None)


def forget() -> None:
    """Drop what is in memory."""
    _Memory.seen.clear()
    _Memory.left.clear()


def _wish(item: bpy.types.PropertyGroup) -> tuple:
    return tuple(item.source), tuple(item.target)


def picked_on(item: bpy.types.PropertyGroup) -> np.ndarray:
    """The palette [M, 3] with which the picture showed the source when it was picked."""
    before = colors.stored(item, "before")
    return before if before.any() else colors.learned(item)  # older files know none


def seen(scene: bpy.types.Scene, name: str) -> ColorHistogram:
    """An object's colors as learned, read once.

    Raises:
        DataError: They are not there, or damaged.
    """
    project = folders.project_of(scene)
    file = project.object_colors_file
    key = file, file.stat().st_mtime_ns if file.exists() else 0, name
    if key not in _Memory.seen:
        _Memory.seen = {known: each for known, each in _Memory.seen.items() if known[:2] == key[:2]}
        _Memory.seen[key] = read_object_colors(project.checked(file), name)
    return _Memory.seen[key]


def _difference(scene: bpy.types.Scene, item: bpy.types.PropertyGroup) -> float:
    own, learned = seen(scene, item.name), Palette(item.name, colors.learned(item))
    before, after = (shown_colors(own, learned, palette) for palette in (picked_on(item), colors.edited(item)))
    reached = reached_color(before, after, np.array(item.source), own.counts)
    return float(ciede2000(srgb_to_lab(reached), srgb_to_lab(np.array(item.target))))
