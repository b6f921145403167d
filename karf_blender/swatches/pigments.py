"""Colors that the artist has added to objects, each with a set of swatches for its pigment (see the engine's `added`).

In the scene a set stands behind the object's learned swatches, as long as they are: first the added color, which is
shown and edited like any swatch, then a hidden one for each learned swatch but black, which it moves.
"""

from collections.abc import Iterable

import bpy
import numpy as np

from .. import progress
from ..engine_api import (
    AddedColor,
    BadRequest,
    ColorHistogram,
    KarfError,
    Palette,
    mean_weights,
    solve_set,
    spread,
)
from . import colors, histograms


def size(item: bpy.types.PropertyGroup) -> int:
    """How many swatches of an object are learned, black among them; what follows are the sets of added colors."""
    return next((index for index, swatch in enumerate(item.swatches) if swatch.is_added), len(item.swatches))


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned, without added colors, [M, 3] float32."""
    return colors.learned(item)[: size(item)]


def palettes(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """The palettes of a scene's objects as learned, without added colors."""
    return tuple(Palette(item.name, learned(item)) for item in scene.karf.objects)


def added(item: bpy.types.PropertyGroup) -> tuple[AddedColor, ...]:
    """The colors that were added to an object."""
    return tuple(_added(swatch) for swatch in item.swatches if swatch.is_added)


def _added(swatch: bpy.types.PropertyGroup) -> AddedColor:
    return AddedColor(np.array(swatch.learned, np.float32), swatch.reach)


def of(scene: bpy.types.Scene) -> dict[str, tuple[AddedColor, ...]]:
    """The added colors of the objects that have some, by name."""
    return {item.name: own for item in scene.karf.objects if (own := added(item))}


def paints(item: bpy.types.PropertyGroup, index: int) -> slice:
    """The swatches whose weights together are what swatch `index` changes: itself, or the set of an added color."""
    is_added = index < len(item.swatches) and item.swatches[index].is_added
    return slice(index, index + (size(item) if is_added else 1))


def seen(item: bpy.types.PropertyGroup) -> ColorHistogram:
    """An object's colors in the photos, whose weights are spread over the sets of its added colors.

    Raises:
        KarfError: There is no project, or it is damaged or has no such object.
    """
    histogram = histograms.of(item.id_data, item.name)
    return histogram._replace(palette_weights=spread(histogram.palette_weights.T, learned(item), added(item)).T)


def shown(item: bpy.types.PropertyGroup, color: np.ndarray) -> np.ndarray:
    """What a color of an object, sRGB [3] as learned, looks like as its swatches stand; exactly itself where none moved.

    Raises:
        KarfError: There is no project, or it is damaged or has no such object.
    """
    own = mean_weights(*seen(item), color)
    return np.clip(color + own @ (colors.edited(item) - colors.learned(item)), 0, 1).astype(np.float32)


def solved(item: bpy.types.PropertyGroup, color: AddedColor, wanted: np.ndarray) -> np.ndarray:
    """The set [M, 3] of an added color with which its pigment looks as wanted, sRGB [3].

    Raises:
        BadRequest: The color is black, and so has no pigment.
        KarfError: There is no project, or it is damaged or has no such object.
    """
    return solve_set(histograms.of(item.id_data, item.name), learned(item), color, wanted)


def paint(item: bpy.types.PropertyGroup, index: int, found: np.ndarray) -> None:
    """Give the swatches of a set, the first of which is `index`, these colors [M, 3]."""
    for number, color in enumerate(found, index):
        item.swatches[number].color = color


def append(item: bpy.types.PropertyGroup, color: AddedColor) -> int:
    """Add a color with its set to an object, as learned; returns its number."""
    count, number = size(item), len(item.swatches)
    first = item.swatches.add()
    first.name = f"Added {number // count}"
    first.is_added, first.reach = True, color.reach
    first.learned = first.color = color.picked
    for index in range(1, count):
        swatch, own = item.swatches.add(), item.swatches[index]
        swatch.name, swatch.merged = f"{first.name} Set", number
        swatch.learned = swatch.color = own.learned
        swatch.before, swatch.after = own.before, own.after  # then the pigment was the learned swatches' still
    return number


def remove(item: bpy.types.PropertyGroup, index: int) -> None:
    """Take an added color, whose number is `index`, away with its set."""
    count = size(item)
    for number in reversed(range(index, index + count)):
        item.swatches.remove(number)
    for number in range(index, len(item.swatches)):
        if item.swatches[number].merged:
            item.swatches[number].merged -= count


def replace(item: bpy.types.PropertyGroup, wanted: Iterable[AddedColor]) -> None:
    """Let an object have these added colors and no others.

    Raises:
        BadRequest: It has others, and one of them is locked.
    """
    wanted = tuple(wanted)
    if keys(wanted) == keys(added(item)):
        return
    if any(swatch.is_added and swatch.locked for swatch in item.swatches):
        raise BadRequest(f"A color that was added to {item.name!r} is locked.", "Unlock it in its menu.")
    while len(item.swatches) > size(item):
        remove(item, size(item))
    for color in wanted:
        append(item, color)


def keys(added_colors: Iterable[AddedColor]) -> list[tuple[float, ...]]:
    """What makes added colors the same ones, as comparable values."""
    return [(*color.picked.tolist(), color.reach) for color in added_colors]


def update(swatch: bpy.types.PropertyGroup) -> None:
    """Let the set of an added color follow it; where it cannot be solved, the set stays and a warning says why."""
    (item,) = (item for item in swatch.id_data.karf.objects if any(each == swatch for each in item.swatches))
    try:
        found = solved(item, _added(swatch), np.array(swatch.color, np.float32))
    except (KarfError, OSError) as error:
        progress.warn(str(error))
        return
    paint(item, next(index for index, each in enumerate(item.swatches) if each == swatch), found)
