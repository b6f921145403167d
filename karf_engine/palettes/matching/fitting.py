"""Fit a palette change that moves colors to targets, within bounds.

Arguments shared by the functions of this module:
    palette_weights: [n, M] weights of n colors over M palette entries.
    colors: sRGB [n, 3] in [0, 1].
    targets: sRGB [n, 3] in [0, 1].
    palette: sRGB [M, 3] in [0, BRIGHTEST]; entry 0 is black and never moves.
    counts: Importance of each color, [n], >= 0.
    locked: Further fixed entries.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from ..palette import MAX_SRGB
from .least_squares import bounded_least_squares

INVISIBLE = 1e-4  # change of a swatch, 1/40 of an 8-bit step
RIDGE = 3e-4  # per unit of counts; keeps rarely used swatches in place
ROUNDS = 4  # of reweighting
MET = 2 / 255  # sRGB distance of a color that meets its target


def match_pixels(
    palette_weights: np.ndarray,
    colors: np.ndarray,
    targets: np.ndarray,
    palette: np.ndarray,
    counts: np.ndarray | None = None,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """Return the palette [M, 3] float32 that moves colors closest to targets, by bounded least squares in sRGB.

    Entries may exceed white: the palette's hull encloses the colors, so brighter colors need brighter entries. Pixels
    are clipped when they are composited.

    Examples:
        >>> palette = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
        >>> weights = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        >>> match_pixels(weights, weights @ palette, [[0.5, 0, 0], [0, 1, 0]], palette).round(2).tolist()
        [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    lower, upper = bounds(palette, locked, MAX_SRGB)
    change = bounded_least_squares(palette_weights, np.subtract(targets, colors), lower, upper, counts, RIDGE)
    return moved(palette, change)


def match_perceptually(
    palette_weights: np.ndarray,
    colors: np.ndarray,
    targets: np.ndarray,
    palette: np.ndarray,
    counts: np.ndarray,
    locked: Iterable[int] = (),
) -> np.ndarray:
    """Return the palette [M, 3] float32 that minimises the sum of CIEDE2000, by iteratively reweighted least squares.

    Unlike `match_pixels` it is robust: colors that the palette cannot move apart (of two paints, or a highlight) do not
    pull all others off their targets. Targets may slightly exceed [0, 1].

    Examples:
        One swatch makes up three colors; two stay and outvote the third, which should turn blue:

        >>> palette, weights = np.array([[0, 0, 0], [0.5, 0.5, 0.5]], np.float32), np.array([[0.0, 1.0]] * 3)
        >>> colors, targets = weights @ palette, np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [0.2, 0.2, 0.8]])
        >>> print(match_pixels(weights, colors, targets, palette)[1].round(2))
        [0.4 0.4 0.6]
        >>> print(match_perceptually(weights, colors, targets, palette, np.ones(3))[1].round(2))
        [0.5 0.5 0.5]
    """
    lower, upper = bounds(palette, locked, MAX_SRGB)
    target_lab, wanted = srgb_to_lab(np.clip(targets, 0, 1)), np.subtract(targets, colors)
    weight = np.ones(len(colors))
    for _ in range(ROUNDS):
        change = bounded_least_squares(palette_weights, wanted, lower, upper, counts * weight, RIDGE)
        difference = ciede2000(srgb_to_lab(np.clip(colors + palette_weights @ change, 0, 1)), target_lab)
        # turns the squared distance into the difference
        weight = difference / (((palette_weights @ change - wanted) ** 2).sum(axis=1) + MET**2)
        if not weight @ counts > 0:  # all targets are met
            break
    return moved(palette, change)


def bounds(palette: np.ndarray, locked: Iterable[int], brightest: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds [M, 3] of a palette change: 0 <= palette + change <= brightest, 0 for black and locked entries.

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
    """Apply a change to a palette, within [0, BRIGHTEST]; swatches with an invisible change keep their bits.

    Examples:
        >>> moved(np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]), np.array([[1e-5, 0, 0], [0.25, 2, -1]])).tolist()
        [[0.5, 0.5, 0.5], [0.75, 2.0, 0.0]]
    """
    palette = np.asarray(palette, np.float32)
    is_invisible = np.abs(change).max(axis=1, keepdims=True) < INVISIBLE
    return np.where(is_invisible, palette, np.clip(palette + change, 0, MAX_SRGB)).astype(np.float32)
