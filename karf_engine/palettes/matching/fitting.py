"""The palette whose change moves colors to targets: bounded least squares, and what bounds it.

Naming: n colors, [n, 3] sRGB. palette_weights [n, M]: each color's share of the M palette entries. Entry 0 is black and
never moves; `locked` lists further entries that stay.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from ..palette import BRIGHTEST
from .least_squares import bounded_least_squares

STILL = 1e-4  # a move of a swatch under this, 1/40 of a step of 8 bits, is rounding
RIDGE = 3e-4  # ridge per unit of counts, which keeps swatches still that hardly any pixel uses
# of `match_seen`, chosen on seeds 0 to 7; more rounds, 6, gain no more than 0.01 CIEDE2000
ROUNDS = 4
MET = 2 / 255  # sRGB distance from a target up to which it counts as met


def match_pixels(
    palette_weights: np.ndarray,
    colors: np.ndarray,
    targets: np.ndarray,
    palette: np.ndarray,
    counts: np.ndarray | None = None,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """The palette that moves n colors closest to n targets, by bounded least squares in sRGB.

    A hull encloses the colors, so its entries lie near the rim of [0, 1] and
    brighter paint needs some beyond white; the pixels themselves are clipped when they are composed.

    Args:
        palette_weights: Of each color, [n, M].
        colors: sRGB [n, 3] in [0, 1].
        targets: What each is to become, sRGB [n, 3] in [0, 1].
        palette: As learned, sRGB [M, 3] in [0, 1].
        counts: Importance of each color, [n], >= 0; by default 1 each.
        locked: Entries that stay as they are.

    Returns:
        The edited palette [M, 3] float32 in [0, BRIGHTEST]; entry 0 and locked ones are the palette's own.

    Examples:
        >>> palette = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
        >>> weights = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        >>> match_pixels(weights, weights @ palette, [[0.5, 0, 0], [0, 1, 0]], palette).round(2).tolist()
        [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    lower, upper = bounds(palette, locked, BRIGHTEST)
    change = bounded_least_squares(palette_weights, np.subtract(targets, colors), lower, upper, counts, RIDGE)
    return moved(palette, change)


def match_seen(
    palette_weights: np.ndarray,
    colors: np.ndarray,
    targets: np.ndarray,
    palette: np.ndarray,
    counts: np.ndarray,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """As `match_pixels`, but what is least is the sum of differences as they are seen, CIEDE2000, and not of squares in sRGB.

    So colors that the palette cannot move apart (those of two paints, a highlight) do not pull all others off their targets.
    By least squares that are weighted anew in each round (iteratively reweighted least squares).

    Args:
        palette_weights: As those of `match_pixels`, like all else.
        colors: sRGB [n, 3] in [0, 1].
        targets: sRGB [n, 3] in [0, 1]; a bit beyond counts as the nearest color inside.
        palette: sRGB [M, 3] in [0, BRIGHTEST].
        counts: [n], >= 0.
        locked: Entries that stay as they are.

    Returns:
        The edited palette [M, 3] float32 in [0, BRIGHTEST].

    Examples:
        Of three colors that one swatch makes up, two stay; the third, which is to turn blue, is outvoted:

        >>> palette, weights = np.array([[0, 0, 0], [0.5, 0.5, 0.5]], np.float32), np.array([[0.0, 1.0]] * 3)
        >>> colors, targets = weights @ palette, np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.2, 0.2, 0.8]])
        >>> print(match_pixels(weights, colors, targets, palette)[1].round(2))
        [0.4 0.4 0.6]
        >>> print(match_seen(weights, colors, targets, palette, np.ones(3))[1].round(2))
        [0.5 0.5 0.5]
    """
    lower, upper = bounds(palette, locked, BRIGHTEST)
    lab, wanted = srgb_to_lab(np.clip(targets, 0, 1)), np.subtract(targets, colors)
    weight = np.ones(len(colors))
    for _ in range(ROUNDS):
        change = bounded_least_squares(palette_weights, wanted, lower, upper, counts * weight, RIDGE)
        difference = ciede2000(srgb_to_lab(np.clip(colors + palette_weights @ change, 0, 1)), lab)
        # a squared distance that is weighted so is the difference itself
        weight = difference / (((palette_weights @ change - wanted) ** 2).sum(axis=1) + MET**2)
        if not weight @ counts > 0:  # all is met
            break
    return moved(palette, change)


def bounds(palette: np.ndarray, locked: Iterable[int], brightest: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds [M, 3] of a palette change: 0 <= palette + change <= brightest; entry 0 and locked ones stay.

    Examples:
        >>> lower, upper = bounds(np.array([[0.0, 0, 0], [0.5, 0.25, 1]]), (), 2.0)
        >>> lower.tolist(), upper.tolist()
        ([[0.0, 0.0, 0.0], [-0.5, -0.25, -1.0]], [[0.0, 0.0, 0.0], [1.5, 1.75, 1.0]])
    """
    palette = np.asarray(palette, np.float64)
    lower, upper = 0 - palette, brightest - palette
    pinned = [0, *locked]
    lower[pinned] = upper[pinned] = 0
    return lower, upper


def moved(palette: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The palette after the change, within [0, BRIGHTEST]; swatches that nobody could see moving keep their bits.

    Examples:
        >>> moved(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]), np.array([[1e-5, 0, 0], [0.25, 2, -1]])).tolist()
        [[0.5, 0.5, 0.5], [0.75, 2.0, 0.0]]
    """
    palette = np.asarray(palette, np.float32)
    still = np.abs(change).max(axis=1, keepdims=True) < STILL
    return np.where(still, palette, np.clip(palette + change, 0, BRIGHTEST)).astype(np.float32)
