"""Shares of weighted points, taken near each point instead of over the whole scene."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

CELLS_PER_DEVIATION = 2
MAX_CELLS = 100  # along an axis


def local_share(
    positions: np.ndarray, weight: np.ndarray, part: np.ndarray, deviation: float, expected: float, prior: float
) -> np.ndarray:
    """Return the share of the weight that belongs to a part, under a Gaussian around each point, [p] in [0, 1].

    Weights are binned on a grid and blurred, so shares are constant within a cell.

    Args:
        positions: [p, 3].
        weight: [p] >= 0.
        part: [p] in [0, weight].
        deviation: of the Gaussian, in the units of positions, > 0.
        expected: share in [0, 1] where nothing is near.
        prior: weight of the expected share, > 0.

    Examples:
        Half of the weight is the part's, and all of it on the left:

        >>> left_and_right = np.array([[0.0, 0, 0], [9, 0, 0]])
        >>> local_share(left_and_right, np.full(2, 1e3), np.array([1e3, 0]), 1.0, 0.5, 1.0).round(2).tolist()
        [1.0, 0.0]
    """
    least, most = positions.min(0), positions.max(0)
    cell = max(deviation / CELLS_PER_DEVIATION, (most - least).max() / MAX_CELLS)
    cells = ((positions - least) / cell).astype(np.intp)
    shape = cells.max(0) + 1
    index = np.ravel_multi_index(tuple(cells.T), shape)
    deviation = deviation / cell

    def blurred(values: np.ndarray) -> np.ndarray:
        sums = np.bincount(index, values, int(shape.prod())).reshape(shape)
        scale = max(np.sqrt(2 * np.pi) * deviation, 1) ** 3  # peak 1; a deviation far below a cell blurs nothing
        return gaussian_filter(sums, deviation, mode="constant", truncate=3).ravel()[index] * scale

    return (blurred(part) + prior * expected) / (blurred(weight) + prior)
