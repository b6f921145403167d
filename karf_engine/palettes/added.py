"""Add swatches to an object for single pigments, without learning anything anew.

A color picked on an object is inside the hull of its palette, so no pixel has a weight for it. Instead it adds a
second set of the object's swatches, which replaces the first where a pixel's own color belongs to the picked pigment.
This depends only on the pixel's palette weights, so it is the same from every viewpoint.

An object with M palette entries and A added colors has M (1 + A) entries: the palette, then a set of M per added
color. Entry 0 of a set is the picked color (or, in an edit, the wanted one), for which pixels have no weight; entry j
is swatch j where the pigment is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..io.color import lab_chroma, lab_saturation, srgb_to_lab
from .color_histogram import ColorHistogram
from .matching.becomes import append_sources
from .matching.fitting import match_pixels
from .matching.paints import GREY_CHROMA, HUE_GATE, hue_difference, pigment_gate, repainted
from .palette import PROTECT, AddedColor, Palette

FEW_NEUTRALS = 0.05  # share of an object; so few are highlights and shades of its pigments
MIN_REACH, PROPOSED_REACH = 0.3, 0.75  # range of proposed reaches
HUE_BINS = np.arange(0, np.pi / HUE_GATE, 0.1)  # hue differences, in units of reach
EMPHASIS_OF_SQUARES = 10.0  # weight of the picked color relative to the whole object
SPARSE = 0.02  # share of an object in a hue bin that counts as a gap
GATE_CLOSED = 1.3  # hue difference over reach that nearly closes the gate


def propose_added_color(seen: ColorHistogram, picked: np.ndarray) -> AddedColor:
    """Propose an added color for a picked color, sRGB [3], with the reach and protection that suit the object's colors.

    The reach ends at a gap in the object's hues, before the next pigment. Neutrals are protected if much of the object
    is neutral (silver, foil, paper).
    """
    lab, source = srgb_to_lab(seen.colors), srgb_to_lab(np.asarray(picked, np.float64))
    if lab_chroma(source) < GREY_CHROMA:  # no hue to compare others with
        return AddedColor(np.asarray(picked, np.float32))
    is_neutral = lab_saturation(lab) < PROTECT * lab_saturation(source)
    distance = np.abs(hue_difference(lab, source)[~is_neutral]) / HUE_GATE
    counts = seen.counts[~is_neutral] / seen.counts.sum()
    is_gap = np.histogram(distance, HUE_BINS, weights=counts)[0] <= SPARSE
    is_other_pigment = ~is_gap & np.logical_or.accumulate(is_gap)
    next_hue = HUE_BINS[is_other_pigment.argmax()] if is_other_pigment.any() else np.inf
    reach = max(MIN_REACH, min(PROPOSED_REACH, next_hue / GATE_CLOSED))
    has_neutrals = counts.sum() < 1 - FEW_NEUTRALS
    return AddedColor(np.asarray(picked, np.float32), float(reach), PROTECT if has_neutrals else 0.0)


def pigment_of_swatch(seen: ColorHistogram, index: int) -> np.ndarray:
    """Return the mean color, sRGB [3], of the object's colors with at least half of the largest weight of a swatch."""
    shares = seen.palette_weights[:, index]
    weights = np.where(shares >= shares.max() / 2, shares * seen.counts, 0)
    return np.average(seen.colors, axis=0, weights=weights if weights.any() else None)


def append_added_sets(palette: np.ndarray, added: Sequence[AddedColor]) -> np.ndarray:
    """Append the sets of added colors to a learned palette [M, 3]: [M (1 + A), 3] float32."""
    sets = [[each.picked, *palette[1:]] for each in added]
    return np.array([*palette, *(color for one in sets for color in one)], np.float32)


def split_weights(weights: np.ndarray, palette: np.ndarray, added: Sequence[AddedColor]) -> np.ndarray:
    """Distribute an object's palette weights over the sets of its added colors; later colors take precedence.

    Weights [M, ...] >= 0 are of pixels, points or colors; the palette is as learned, sRGB [M, 3]. Returns
    [M (1 + A), ...] of the same dtype, whose parts add up exactly; without added colors, the weights themselves.
    """
    if not added:
        return weights
    total = weights.sum(axis=0, dtype=np.float32)
    covered = total > 0
    inside = weights[:, covered].astype(np.float32)
    own = np.clip((inside / total[covered]).T @ np.asarray(palette, np.float32), 0, 1)
    free, rest, sets = np.ones(len(own), np.float32), inside[1:], []
    # spacing of the dtype at each weight: multiples of it subtract exactly
    step = np.maximum(np.spacing(weights[1:, covered]).astype(np.float32), np.finfo(np.float32).tiny)
    for each in reversed(added):
        share = free * pigment_gate(own, each.picked, each.reach, each.protect).astype(np.float32)
        free -= share
        part = np.minimum(np.rint(share * inside[1:] / step) * step, rest)
        rest = rest - part
        sets[:0] = [np.zeros_like(share), *part]
    result = np.zeros((len(weights) * (1 + len(added)), *weights.shape[1:]), weights.dtype)
    # black stays in the first set: it is the same in all
    result[:, covered] = [inside[0], *rest, *sets]
    return result


def split_weights_of_objects(
    weights: np.ndarray, palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]
) -> np.ndarray:
    """Apply `split_weights` to the weights [K, M, ...] of K objects, zero padded to the largest M (1 + A)."""
    if not any(added.get(palette.name) for palette in palettes):
        return weights
    parts = [
        split_weights(planes[: len(palette.colors)], palette.colors, added.get(palette.name, ()))
        for planes, palette in zip(weights, palettes, strict=True)
    ]
    result = np.zeros((len(parts), max(map(len, parts)), *weights.shape[2:]), weights.dtype)
    for planes, part in zip(result, parts, strict=True):
        planes[: len(part)] = part
    return result


def extended_palettes(palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]) -> tuple[Palette, ...]:
    """Append the sets of added colors, given by object name, to learned palettes."""
    return tuple(Palette(each.name, append_added_sets(each.colors, added.get(each.name, ()))) for each in palettes)


def match_added_color(seen: ColorHistogram, palette: np.ndarray, added: AddedColor, wanted: np.ndarray) -> np.ndarray:
    """Solve for the set of an added color that gives its pigment the wanted color and keeps shading and gloss.

    The palette [M, 3] is as learned; `wanted`, sRGB [3] in [0, MAX_SRGB], is the new color of the picked one. Returns
    [M, 3] float32 sRGB, the wanted color first. Raises BadRequest if the picked color is black.
    """
    colors, counts, weights = seen
    counts = counts * pigment_gate(colors, added.picked, added.reach, added.protect)
    targets = repainted(colors, added.picked, wanted)
    weights, colors, targets, counts = append_sources(
        colors, counts, weights, targets, added.picked, wanted, EMPHASIS_OF_SQUARES
    )
    return np.array([wanted, *match_pixels(weights, colors, targets, palette, counts)[1:]], np.float32)
