"""Colors that an artist adds to an object: more swatches for one pigment of it, without anything being learned anew.

A color that is picked on an object lies inside the hull of its palette, so no pixel has a weight of it. It brings a
second set of the object's swatches instead, which takes the place of the first one where a pixel's own color is of the
picked pigment: a function of what the pixel has anyway, the same from every side.

Naming: an object whose palette has M entries and A added colors has M (1 + A) in all: the palette, then for each added
color its set of M. The set's entry 0, where the palette has black, is the picked color itself, of which pixels have no
weight; entry j is swatch j as it is where the pigment is. With the color that is wanted in place of the picked one, and
the swatches that then make it up, a set is one part of an edited palette like any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..io.color import lab_chroma, lab_hue, lab_saturation, srgb_to_lab
from .matching.becomes import match_pigment
from .matching.paints import GREY_CHROMA, HUE_GATE, pigment_gate
from .object_colors import ColorHistogram
from .palette import PROTECT, AddedColor, Palette

FEW_NEUTRALS = 0.05  # share of an object up to which neutral colors are its pigments' highlights and shades
PROPOSED_REACH = 0.75  # where no other pigment is near; chosen with PROTECT
LEAST_REACH = 0.3
HUE_BINS = np.arange(0, np.pi / HUE_GATE, 0.1)  # distances in hue, in units of reach
SPARSE = 0.02  # share of an object up to which a bin of hues is the gap between two pigments
BEYOND = 1.3  # distance in hue over reach from which hardly anything of a color is of a pigment


def proposed(seen: ColorHistogram, picked: np.ndarray) -> AddedColor:
    """A color of an object as a pigment that reaches as far as the object's own colors propose.

    It ends before the next pigment, beyond a gap in the object's hues. Where much of the object is neutral (silver, foil,
    paper), neutrals are protected.

    Args:
        seen: The object's colors.
        picked: One of them, sRGB [3] in [0, 1].

    Examples:
        Red letters on silver, and a red beside an orange:

        >>> red, silver, orange = [0.7, 0.1, 0.1], [0.6, 0.6, 0.62], [0.8, 0.4, 0.1]
        >>> for other in (silver, orange):
        ...     color = proposed(ColorHistogram(np.array([red, other]), np.array([9, 9]), np.eye(2)), np.array(red))
        ...     print(round(color.reach, 2), color.protect)
        0.75 0.1
        0.38 0.0
    """
    lab, source = srgb_to_lab(seen.colors), srgb_to_lab(np.asarray(picked, np.float64))
    if lab_chroma(source) < GREY_CHROMA:  # it has no hue, by which others could be told apart
        return AddedColor(np.asarray(picked, np.float32))
    is_neutral = lab_saturation(lab) < PROTECT * lab_saturation(source)
    turn = (lab_hue(lab) - lab_hue(source) + np.pi) % (2 * np.pi) - np.pi
    away, counts = np.abs(turn[~is_neutral]) / HUE_GATE, seen.counts[~is_neutral] / seen.counts.sum()
    is_gap = np.histogram(away, HUE_BINS, weights=counts)[0] <= SPARSE
    is_next = ~is_gap & np.logical_or.accumulate(is_gap)
    following = HUE_BINS[is_next.argmax()] if is_next.any() else np.inf
    reach = max(LEAST_REACH, min(PROPOSED_REACH, following / BEYOND))
    has_neutrals = counts.sum() < 1 - FEW_NEUTRALS
    return AddedColor(np.asarray(picked, np.float32), float(reach), PROTECT if has_neutrals else 0.0)


def pigment_of_swatch(seen: ColorHistogram, index: int) -> np.ndarray:
    """The color of an object that a swatch paints most, sRGB [3]: the mean of those of which it is half as much or more.

    Args:
        seen: The object's colors.
        index: The swatch's number.

    Examples:
        >>> seen = ColorHistogram(np.array([[0.8, 0, 0], [0.5, 0.4, 0.4]]), np.array([5, 9]), np.array([[0, 0.9], [0.8, 0.2]]))
        >>> pigment_of_swatch(seen, 1).tolist()
        [0.8, 0.0, 0.0]
    """
    shares = seen.palette_weights[:, index]
    weights = np.where(shares >= shares.max() / 2, shares * seen.counts, 0)
    return np.average(seen.colors, axis=0, weights=weights if weights.any() else None)


def with_sets(palette: np.ndarray, added: Sequence[AddedColor]) -> np.ndarray:
    """An object's palette [M, 3] as learned, with the sets of its added colors, [M (1 + A), 3] float32.

    Examples:
        >>> palette = np.array([[0, 0, 0], [1, 0.5, 0]])
        >>> with_sets(palette, [AddedColor(np.array([0.5, 0.25, 0]))]).tolist()
        [[0.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.5, 0.25, 0.0], [1.0, 0.5, 0.0]]
    """
    sets = [[each.picked, *palette[1:]] for each in added]
    return np.array([*palette, *(color for one in sets for color in one)], np.float32)


def spread(weights: np.ndarray, palette: np.ndarray, added: Sequence[AddedColor]) -> np.ndarray:
    """An object's palette weights, spread over the sets of its added colors; a later color goes before an earlier one.

    Args:
        weights: [M, ...] of pixels, points or colors, >= 0.
        palette: As learned, sRGB [M, 3] in [0, 1].
        added: The A added colors.

    Returns:
        [M (1 + A), ...] of the same type; the parts of a weight add up to its very bits, so that sets that are as the
        swatches are change no picture. Without added colors the weights themselves.

    Examples:
        A red and a blue pixel of a pot, of which the blue is taken apart:

        >>> palette = np.array([[0, 0, 0], [0.8, 0.1, 0.1], [0.1, 0.1, 0.8]])
        >>> blue = AddedColor(np.array([0.1, 0.1, 0.7]))
        >>> spread(np.array([[0, 0], [1.0, 0], [0, 1.0]]), palette, [blue]).round(2).tolist()[1:]
        [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    """
    if not added:
        return weights
    total = weights.sum(axis=0, dtype=np.float32)
    covered = total > 0
    inside = weights[:, covered].astype(np.float32)
    own = np.clip((inside / total[covered]).T @ np.asarray(palette, np.float32), 0, 1)
    left, rest, sets = np.ones(len(own), np.float32), inside[1:], []
    # the type's numbers up to a weight are multiples of it
    step = np.maximum(np.spacing(weights[1:, covered]).astype(np.float32), np.finfo(np.float32).tiny)
    for each in reversed(added):
        share = left * pigment_gate(own, each.picked, each.reach, each.protect).astype(np.float32)
        left -= share
        part = np.minimum(np.rint(share * inside[1:] / step) * step, rest)
        rest = rest - part
        sets[:0] = [np.zeros_like(share), *part]
    result = np.zeros((len(weights) * (1 + len(added)), *weights.shape[1:]), weights.dtype)
    # black has no set: it is the same in all of them
    result[:, covered] = [inside[0], *rest, *sets]
    return result


def spread_objects(
    weights: np.ndarray, palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]
) -> np.ndarray:
    """`spread` of K objects, [K, M, ...] to the largest M (1 + A) of them; their added colors by their names.

    Examples:
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.1, 0.1, 0.8]]))
        >>> blue = AddedColor(np.array([0.1, 0.1, 0.7]))
        >>> spread_objects(np.array([[[0.5], [0.5]]]), [pot], {"pot": [blue]})[0, :, 0].round(2).tolist()
        [0.5, 0.0, 0.0, 0.5]
    """
    if not any(added.get(palette.name) for palette in palettes):
        return weights
    parts = [
        spread(planes[: len(palette.colors)], palette.colors, added.get(palette.name, ()))
        for planes, palette in zip(weights, palettes, strict=True)
    ]
    result = np.zeros((len(parts), max(map(len, parts)), *weights.shape[2:]), weights.dtype)
    for planes, part in zip(result, parts, strict=True):
        planes[: len(part)] = part
    return result


def palettes_with(palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]) -> tuple[Palette, ...]:
    """Palettes as learned, with the sets of added colors, which are given by the objects' names.

    Examples:
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.1, 0.1, 0.8]]))
        >>> (longer,) = palettes_with([pot], {"pot": [AddedColor(np.array([0.1, 0.1, 0.7]))]})
        >>> longer.colors.shape
        (4, 3)
    """
    return tuple(Palette(each.name, with_sets(each.colors, added.get(each.name, ()))) for each in palettes)


def solve_set(seen: ColorHistogram, palette: np.ndarray, added: AddedColor, wanted: np.ndarray) -> np.ndarray:
    """The set of an added color with which its pigment looks as wanted, shading and gloss kept.

    Args:
        seen: The object's colors.
        palette: As learned, sRGB [M, 3] in [0, 1].
        added: The added color.
        wanted: What the picked color becomes, sRGB [3] in [0, BRIGHTEST].

    Returns:
        [M, 3] float32 sRGB, the wanted color first; where that is the picked one, exactly as learned.

    Raises:
        BadRequest: The picked color is black.

    Examples:
        >>> palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1]], np.float32)
        >>> seen = ColorHistogram(np.array([[0.7, 0.1, 0.1]]), np.array([9]), np.array([[0.0, 1.0]]))
        >>> print(solve_set(seen, palette, AddedColor(palette[1]), np.array([0.1, 0.2, 0.7])).round(2))
        [[0.1 0.2 0.7]
         [0.1 0.2 0.7]]
    """
    colors = match_pigment(*seen, palette, added.picked, wanted, added.reach, added.protect)
    return np.array([wanted, *colors[1:]], np.float32)
