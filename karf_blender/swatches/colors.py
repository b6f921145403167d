"""The colors of an object's swatches as arrays: as learned, as edited, and those that the artist has added.

Each added color has a set of swatches for its pigment (see the engine's `added`). In the scene a set stands behind the
object's learned swatches, as long as they are: first the added color, which is shown and edited like any swatch, then a
hidden one for each learned swatch but black, which it moves.
"""

from collections.abc import Iterable

import bpy
import numpy as np

from ..engine_api import (
    AddedColor,
    ColorHistogram,
    Palette,
    ciede2000,
    reached_color,
    shown_colors,
    spread,
    srgb_to_lab,
)


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned and the sets of its added colors, [M, 3] float32."""
    return stored(item, "learned")


def edited(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as edited, [M, 3] float32; black stays black."""
    colors = stored(item, "color")
    colors[:1] = learned(item)[:1]
    return colors


def stored(item: bpy.types.PropertyGroup, name: str) -> np.ndarray:
    """A color property of all swatches of an object, [M, 3] float32."""
    flat = np.empty(len(item.swatches) * 3, np.float32)
    item.swatches.foreach_get(name, flat)
    return flat.reshape(-1, 3)


def picked_with(item: bpy.types.PropertyGroup) -> np.ndarray:
    """The palette [M, 3] with which the picture showed the object's source color: the learned one before any was picked."""
    before = stored(item, "before")
    return before if before.any() else learned(item)


def palette(item: bpy.types.PropertyGroup) -> Palette:
    """An object's palette as learned, without added colors."""
    return Palette(item.name, learned(item)[: size(item)])


def palettes(scene: bpy.types.Scene) -> tuple[Palette, ...]:
    """The palettes of a scene's objects as learned, without added colors."""
    return tuple(palette(item) for item in scene.karf.objects)


def size(item: bpy.types.PropertyGroup) -> int:
    """How many swatches of an object are learned, black among them; what follows are the sets of added colors."""
    return next((index for index, swatch in enumerate(item.swatches) if swatch.is_added), len(item.swatches))


def added_color(swatch: bpy.types.PropertyGroup) -> AddedColor:
    """The color that was added with the first swatch of a set."""
    return AddedColor(np.array(swatch.learned, np.float32), swatch.reach)


def added(item: bpy.types.PropertyGroup) -> tuple[AddedColor, ...]:
    """The colors that were added to an object."""
    return tuple(added_color(swatch) for swatch in item.swatches if swatch.is_added)


def added_by_object(scene: bpy.types.Scene) -> dict[str, tuple[AddedColor, ...]]:
    """The added colors of the objects that have some, by name."""
    return {item.name: own for item in scene.karf.objects if (own := added(item))}


def keys(added_colors: Iterable[AddedColor]) -> list[tuple[float, ...]]:
    """What makes added colors the same ones, as comparable values."""
    return [(*color.picked.tolist(), color.reach) for color in added_colors]


def painted_by(item: bpy.types.PropertyGroup, index: int) -> slice:
    """The swatches whose weights together are what swatch `index` changes: itself, or the set of an added color."""
    is_added = index < len(item.swatches) and item.swatches[index].is_added
    return slice(index, index + (size(item) if is_added else 1))


def with_added(item: bpy.types.PropertyGroup, histogram: ColorHistogram) -> ColorHistogram:
    """An object's colors in the photos with weights that are spread over the sets of its added colors."""
    weights = spread(histogram.palette_weights.T, palette(item).colors, added(item)).T
    return histogram._replace(palette_weights=weights)


def color_pair(item: bpy.types.PropertyGroup) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """An object's source and target color; they are the same where there is no target."""
    return tuple(item.source), tuple(item.target)


def difference_to_target(item: bpy.types.PropertyGroup, histogram: ColorHistogram) -> float:
    """CIEDE2000 of what the source color has become to the target. histogram: with the sets of added colors."""
    whole = Palette(item.name, learned(item))
    before, after = (shown_colors(histogram, whole, each) for each in (picked_with(item), edited(item)))
    reached = reached_color(before, after, np.array(item.source), histogram.counts)
    return float(ciede2000(srgb_to_lab(reached), srgb_to_lab(np.array(item.target))))


def fingerprint(scene: bpy.types.Scene) -> bytes:
    """All that keyframes can change in a picture, as one comparable value."""
    palettes = [edited(item).tobytes() for item in scene.karf.objects]
    return b"".join([scene.karf.compositing.encode(), scene.karf.active_view.encode(), *palettes])
