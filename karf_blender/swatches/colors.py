"""The colors of an object's swatches as arrays: as learned, as edited, and those that the artist has added.

Each added color has a set of swatches for its pigment (see the engine's `added`). In the scene a set stands behind the
object's learned swatches, as long as they are: first the added color, which is shown and edited like any swatch, then a
hidden one for each learned swatch but black, which it moves.
"""

from collections.abc import Iterable

import bpy
import numpy as np

from ..engine_api import (
    MAX_SRGB,
    AddedColor,
    ColorHistogram,
    EdgeShape,
    Palette,
    ciede2000,
    hex_to_rgb,
    reached_color,
    residual_delta_e,
    shown_colors,
    split_weights,
    srgb_to_lab,
    to_mean_exposure,
)

FOREIGN = 10.0  # CIEDE2000 from which a color does not look like another at all
LEAST_SHOWN = 1e-3  # share of an object's pixels up to which a color is a stray one


def learned(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as learned and the sets of its added colors, [M, 3] float32."""
    return stored(item, "learned")


def chosen(item: bpy.types.PropertyGroup) -> np.ndarray:
    """The colors that an object's swatches were given, [M, 3] float32; black stays black."""
    colors = stored(item, "color")
    colors[:1] = learned(item)[:1]
    return colors


def edited(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's palette as edited, [M, 3] float32: the chosen colors with what surfaces add; black stays black."""
    return np.clip(chosen(item) + stored(item, "shift"), 0, MAX_SRGB)


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
    return AddedColor(np.array(swatch.learned, np.float32), swatch.reach, swatch.protect)


def added(item: bpy.types.PropertyGroup) -> tuple[AddedColor, ...]:
    """The colors that were added to an object."""
    return tuple(added_color(swatch) for swatch in item.swatches if swatch.is_added)


def added_by_object(scene: bpy.types.Scene) -> dict[str, tuple[AddedColor, ...]]:
    """The added colors of the objects that have some, by name."""
    return {item.name: own for item in scene.karf.objects if (own := added(item))}


def edges(scene: bpy.types.Scene) -> dict[str, EdgeShape]:
    """How the edges of the objects are moved and faded, by name; none of those that stay as they are."""
    return {item.name: shape for item in scene.karf.objects if not (shape := edge(item)).is_neutral}


def edge(item: bpy.types.PropertyGroup) -> EdgeShape:
    """How an object's edge is moved and faded."""
    return EdgeShape(item.choke, item.feather)


def keys(added_colors: Iterable[AddedColor]) -> list[tuple[float, ...]]:
    """What makes added colors the same ones, as comparable values."""
    return [(*color.picked.tolist(), color.reach, color.protect) for color in added_colors]


def painted_by(item: bpy.types.PropertyGroup, index: int) -> slice:
    """The swatches whose weights together are what swatch `index` changes: itself, or the set of an added color."""
    is_added = index < len(item.swatches) and item.swatches[index].is_added
    return slice(index, index + (size(item) if is_added else 1))


def with_added(item: bpy.types.PropertyGroup, histogram: ColorHistogram) -> ColorHistogram:
    """An object's colors in the photos with weights that are spread over the sets of its added colors."""
    weights = split_weights(histogram.palette_weights.T, palette(item).colors, added(item)).T
    return histogram._replace(palette_weights=weights)


def color_pair(item: bpy.types.PropertyGroup) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """An object's source and target color; they are the same where there is no target."""
    return tuple(item.source), tuple(item.target)


def source(item: bpy.types.PropertyGroup) -> np.ndarray:
    """An object's source color, sRGB [3], as it is in the mean exposure of all photos, which palettes have."""
    return to_mean_exposure(np.array(item.source, np.float32), item.gains)


def is_shown(colors: np.ndarray, counts: np.ndarray, color: np.ndarray) -> bool:
    """Whether a color [3] is one of an object that shows `colors` [n, 3] so often, [n]."""
    alike = ciede2000(srgb_to_lab(colors), srgb_to_lab(color)) <= FOREIGN
    return bool(counts[alike].sum() > LEAST_SHOWN * counts.sum())


def left_to_target(item: bpy.types.PropertyGroup, histogram: ColorHistogram) -> float:
    """What is left to do until an object's source color has become its target: mean CIEDE2000 of the whole object.

    A color alone tells little: it may be met while highlights turn green. By the rule of fewest swatches nothing but the
    color itself is to be met.

    Args:
        item: The object.
        histogram: Its colors in the photos, with the sets of added colors.

    Returns:
        Infinity where the object shows no such source color.
    """
    picked, target, whole = source(item), np.array(item.target), Palette(item.name, learned(item))
    before, after = (shown_colors(histogram, whole, each) for each in (picked_with(item), edited(item)))
    if not is_shown(before, histogram.counts, picked):
        return np.inf
    if item.rule == "fewest":
        reached = reached_color(before, after, picked, histogram.counts)
        return float(ciede2000(srgb_to_lab(reached), srgb_to_lab(target)))
    return residual_delta_e(before, after, histogram.counts, picked, target, held(item), item.is_metal)


def held(item: bpy.types.PropertyGroup) -> list[np.ndarray]:
    """Colors that other paints of an object were given before, sRGB [3] each."""
    return [hex_to_rgb(text) for text in item.held.split()]


def fingerprint(scene: bpy.types.Scene) -> bytes:
    """All that keyframes can change in a picture, as one comparable value."""
    palettes = [edited(item).tobytes() for item in scene.karf.objects]
    ends = repr(edges(scene)).encode()
    return b"".join([scene.karf.compositing.encode(), scene.karf.active_view.encode(), ends, *palettes])
