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

from .matching.becomes import match_pigment
from .matching.paints import pigment_gate
from .object_colors import ColorHistogram
from .palette import AddedColor, Palette


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
        [M (1 + A), ...] of the same type, with the same sum; without added colors the weights themselves.

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
    left, sets = np.ones(len(own), np.float32), []
    for each in reversed(added):
        share = left * pigment_gate(own, each.picked, each.reach).astype(np.float32)
        left -= share
        sets[:0] = [np.zeros_like(share), *(share * inside[1:])]
    result = np.zeros((len(weights) * (1 + len(added)), *weights.shape[1:]), weights.dtype)
    # black has no set: it is the same in all of them
    result[:, covered] = [inside[0], *(left * inside[1:]), *sets]
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
    colors = match_pigment(*seen, palette, added.picked, wanted, added.reach)
    return np.array([wanted, *colors[1:]], np.float32)
