"""Bounded linear least squares in numpy alone, as Blender's Python lacks scipy."""

from __future__ import annotations

import numpy as np


def bounded_least_squares(
    matrix: np.ndarray,
    values: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    counts: np.ndarray | None = None,
    ridge: float = 0.0,
) -> np.ndarray:
    """Minimise `sum_i counts_i |matrix_i x - values_i|^2 + ridge sum(counts) |x|^2` with lower <= x <= upper, exactly.

    A primal active-set method (Nocedal and Wright, "Numerical Optimization", 2006, 16.5).

    Args:
        matrix: [n, M].
        values: [n, C]; the columns are solved independently.
        lower: [M, C], <= 0.
        upper: [M, C], >= 0; entries with equal bounds are fixed.
        counts: [n], >= 0; by default 1 each.
        ridge: Per unit of counts, >= 0.

    Returns:
        x [M, C] float64.

    Examples:
        >>> lower, upper = np.zeros((2, 1)), np.ones((2, 1))
        >>> bounded_least_squares(np.eye(2), np.array([[0.25], [3.0]]), lower, upper).round(6).tolist()
        [[0.25], [1.0]]
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
