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

from ..io.color import lab_chroma, lab_hue, lab_saturation, srgb_to_lab
from .color_histogram import ColorHistogram
from .matching.becomes import append_sources, mean_weights
from .matching.fitting import match_perceptually
from .matching.paints import GREY_CHROMA, HUE_GATE, hue_difference, pigment_gate, repainted, smooth_step
from .palette import MAX_SRGB, PROTECT, AddedColor, Palette

FEW_NEUTRALS = 0.05  # share of an object; so few are highlights and shades of its pigments
MIN_REACH, PROPOSED_REACH = 0.3, 0.75  # range of proposed reaches
HUE_BINS = np.arange(0, np.pi / HUE_GATE, 0.1)  # hue differences, in units of reach
EMPHASIS = 3.0  # weight of the picked color relative to the whole object
HUES = np.arange(-180, 180) * np.pi / 180  # radians, at which the density of hues is sampled
HUE_SPREAD = 0.15  # of a paint's colors about its hue, radians
COLORED = 0.25  # Lab saturation above which a color counts fully as that of a paint
MIN_PAINT = 0.02  # share of an object, weighted by saturation
PALER = 0.5  # share of a paint that is left out of its picked color: shade, and rims that are mixtures with white
APART = 0.4  # least hue difference of two paints, radians
VALLEY = 0.6  # density between two paints, relative to that of the weaker one
NEUTRAL_BINS = np.linspace(0, 0.2, 6)  # saturations that neutrals can have, relative to a paint's
NEUTRAL_BIN = 0.03  # least share of an object in a bin that is not of a print's rims
DARK = 15.0  # Lab lightness below which a color is that of shade
MIN_NEUTRAL = 0.2  # share of an object that makes a single paint a print on something neutral
ROUNDS = 4  # of correcting a wanted color
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


def object_paints(seen: ColorHistogram) -> tuple[AddedColor, ...]:
    """Return the paints of an object that has several, or one beside neutrals, as added colors; the main one first.

    A paint is a mode of the hues that the object shows. An object of one paint has none.
    """
    lab = srgb_to_lab(seen.colors)
    saturation = lab_saturation(lab)
    colored = smooth_step(saturation, COLORED / 2, COLORED) * (lab_chroma(lab) > 2 * GREY_CHROMA)
    weights = colored * seen.counts / seen.counts.sum()
    kernel = np.exp(-0.5 * (_turn(HUES[:, None] - lab_hue(lab)) / HUE_SPREAD) ** 2)
    density, found = kernel @ weights, []
    for peak in np.argsort(-density, kind="stable"):
        if density[peak] >= MIN_PAINT and all(_is_apart(density, peak, other) for other in found):
            found.append(peak)
    found.sort(key=lambda peak: -(kernel[peak] @ (weights * saturation)))
    paints = tuple(_paint_of_hue(seen, weights * kernel[peak], HUES[found] - HUES[peak]) for peak in found)
    if len(paints) == 1:
        gate = pigment_gate(seen.colors, paints[0].picked, paints[0].reach, paints[0].protect)
        is_other = (gate < 0.5) & (lab[:, 0] > DARK)
        if seen.counts[is_other].sum() < MIN_NEUTRAL * seen.counts.sum():
            return ()
    return paints


def paint_of(seen: ColorHistogram, color: np.ndarray) -> AddedColor:
    """Return the paint of an object that a color, sRGB [3], belongs to; the color as a paint if it is of none."""
    paints = object_paints(seen)
    shares = [pigment_gate(np.array([color]), each.picked, each.reach, each.protect)[0] for each in paints]
    return paints[int(np.argmax(shares))] if max(shares, default=0) > 0.5 else propose_added_color(seen, color)


def _is_apart(density: np.ndarray, first: int, second: int) -> bool:
    """Return whether two of the sampled hues are of different paints: far apart, with a valley between them."""
    between = np.roll(density, -first)[: (second - first) % len(density) + 1]
    around = np.roll(density, -second)[: (first - second) % len(density) + 1]
    is_far = abs(_turn(HUES[first] - HUES[second])) >= APART
    return bool(is_far and max(between.min(), around.min()) <= VALLEY * min(density[first], density[second]))


def _paint_of_hue(seen: ColorHistogram, weights: np.ndarray, to_others: np.ndarray) -> AddedColor:
    """Return the paint of colors with these weights [n]; its reach ends before other paints, by hue differences [P].

    The picked color is the mean of the colors with the most chroma.
    """
    by_chroma = np.argsort(lab_chroma(srgb_to_lab(seen.colors)))
    share = np.cumsum(weights[by_chroma]) / weights.sum()
    pure = by_chroma[share >= PALER]
    picked = np.average(seen.colors[pure], axis=0, weights=weights[pure])
    nearest = np.abs(_turn(to_others)[to_others != 0]).min(initial=np.inf)
    reach = min(propose_added_color(seen, picked).reach, nearest / (GATE_CLOSED * HUE_GATE))
    return AddedColor(picked.astype(np.float32), float(reach), _protection(seen, picked, reach))


def _protection(seen: ColorHistogram, picked: np.ndarray, reach: float) -> float:
    """Return the protection that keeps neutrals tinted with a paint's hue: paper and silver in colored light."""
    saturation = lab_saturation(srgb_to_lab(seen.colors)) / lab_saturation(srgb_to_lab(picked))
    shares = seen.counts / seen.counts.sum() * pigment_gate(seen.colors, picked, reach)
    mass = np.histogram(saturation, NEUTRAL_BINS, weights=shares)[0]
    last = np.flatnonzero(mass > NEUTRAL_BIN).max(initial=-1)
    return float(max(PROTECT, 2 * NEUTRAL_BINS[last + 1]))


def _turn(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


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
        gate = pigment_gate(own, each.picked, each.reach, each.protect) if each.reach else 0 * free
        share = free * gate.astype(np.float32)
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
    weights, colors, targets, counts = append_sources(colors, counts, weights, targets, added.picked, wanted, EMPHASIS)
    return np.array([wanted, *match_perceptually(weights, colors, targets, palette, counts)[1:]], np.float32)


def wanted_color(
    seen: ColorHistogram, palette: np.ndarray, added: AddedColor, source: np.ndarray, target: np.ndarray
) -> np.ndarray:
    """Return the wanted color, sRGB [3], that makes `match_added_color` turn a source color into a target.

    The source, sRGB [3], is as learned: a shade of the picked color. Raises BadRequest if it is black.
    """
    (wanted,) = repainted(added.picked[None], source, target)
    own = mean_weights(*seen, source)[1:]
    for _ in range(ROUNDS):
        change = match_added_color(seen, palette, added, wanted)[1:] - palette[1:]
        wanted = np.clip(wanted + target - np.clip(source + own @ change, 0, 1), 0, MAX_SRGB)
    return wanted.astype(np.float32)
