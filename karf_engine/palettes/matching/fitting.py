"""Fit a palette change that moves colors to targets, within bounds.

Colors and targets are sRGB [n, 3] in [0, 1], with palette weights [n, M] and counts [n] >= 0, their importance. A palette
is sRGB [M, 3] in [0, MAX_SRGB]; entry 0 is black and never moves, nor do the `locked` entries.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from ..palette import MAX_SRGB

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
    """
    lower, upper = bounds(palette, locked, MAX_SRGB)
    change = bounded_least_squares(palette_weights, np.subtract(targets, colors), lower, upper, counts, RIDGE)
    return apply_change(palette, change)


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
    return apply_change(palette, change)


def bounds(palette: np.ndarray, locked: Iterable[int], brightest: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds [M, 3] of a palette change: 0 <= palette + change <= brightest, 0 for black and locked entries."""
    palette = np.asarray(palette, np.float64)
    lower, upper = 0 - palette, brightest - palette
    pinned = [0, *locked]
    lower[pinned] = upper[pinned] = 0
    return lower, upper


def apply_change(palette: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Apply a change to a palette, within [0, MAX_SRGB]; swatches with an invisible change keep their bits."""
    palette = np.asarray(palette, np.float32)
    is_invisible = np.abs(change).max(axis=1, keepdims=True) < INVISIBLE
    return np.where(is_invisible, palette, np.clip(palette + change, 0, MAX_SRGB)).astype(np.float32)


def bounded_least_squares(
    matrix: np.ndarray,  # [n, M]
    values: np.ndarray,  # [n, C]; the columns are solved independently
    lower: np.ndarray,  # [M, C], <= 0
    upper: np.ndarray,  # [M, C], >= 0; entries with equal bounds are fixed
    counts: np.ndarray | None = None,  # [n], >= 0; by default 1 each
    ridge: float = 0.0,  # per unit of counts, >= 0
) -> np.ndarray:
    """Minimise `sum_i counts_i |matrix_i x - values_i|^2 + ridge sum(counts) |x|^2` with lower <= x <= upper, exactly.

    A primal active-set method (Nocedal and Wright, "Numerical Optimization", 2006, 16.5) in numpy alone, as Blender's
    Python lacks scipy. Returns x [M, C] float64.
    """
    matrix, values = np.asarray(matrix, np.float64), np.asarray(values, np.float64)
    importance = np.ones(len(matrix)) if counts is None else np.asarray(counts, np.float64)
    weighted = matrix * (importance / importance.sum())[:, None]
    # a minimal ridge makes the problem strictly convex, so that every subset of entries can be solved
    normal = weighted.T @ matrix + max(ridge, 1e-12) * np.eye(matrix.shape[1])
    right = weighted.T @ values
    columns = [_active_set(normal, right[:, c], lower[:, c], upper[:, c]) for c in range(values.shape[1])]
    return np.stack(columns, axis=1)


def _active_set(normal: np.ndarray, right: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Minimise x normal x / 2 - right x in the box, starting from x = 0; normal [M, M] is positive definite."""
    x = np.zeros(len(right))
    free = lower < upper
    for _ in range(20 * len(right)):  # every free set lowers the objective, so none recurs
        best = x.copy()
        if free.any():
            fixed = right[free] - normal[np.ix_(free, ~free)] @ x[~free]
            best[free] = np.linalg.solve(normal[np.ix_(free, free)], fixed)
        step = best - x
        limit = np.where(step > 0, upper, lower)
        room = np.divide(limit - x, step, out=np.full_like(x, np.inf), where=free & (step != 0))
        blocking = int(room.argmin())
        if room[blocking] < 1:
            x = x + room[blocking] * step
            x[blocking] = limit[blocking]
            free[blocking] = False
            continue
        x = best
        downhill = right - normal @ x
        release_gain = np.where(x >= upper, -downhill, downhill)
        release_gain[free | (lower == upper)] = 0
        release = int(release_gain.argmax())
        if release_gain[release] <= 1e-10:
            return x
        free[release] = True
    return x
