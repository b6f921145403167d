"""A share of some weighted points, told near each point: what holds in a scene as a whole may not hold here."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

CELLS_IN_REACH = 2  # per standard deviation of the Gaussian
MOST_CELLS = 100  # along an axis, however short the reach


def share_nearby(
    positions: np.ndarray, weight: np.ndarray, part: np.ndarray, reach: float, expected: float, prior: float
) -> np.ndarray:
    """Share of the weight that is a part's, under a Gaussian round each point.

    Weights are summed in the cells of a grid and blurred there, so a share steps by half the reach.

    Args:
        positions: [p, 3].
        weight: [p] >= 0.
        part: [p] in [0, weight].
        reach: standard deviation of the Gaussian, in the units of positions, > 0.
        expected: share in [0, 1] where nothing is near.
        prior: weight that the expected share has against what is near, > 0.

    Returns:
        [p] in [0, 1].

    Examples:
        Half of the weight is the part's, and all of it on the left:

        >>> left_and_right = np.array([[0.0, 0, 0], [9, 0, 0]])
        >>> share_nearby(left_and_right, np.full(2, 1e3), np.array([1e3, 0]), 1.0, 0.5, 1.0).round(2).tolist()
        [1.0, 0.0]

        A reach that is far shorter than a cell counts what is in the cell:

        >>> share_nearby(left_and_right, np.full(2, 1e3), np.array([1e3, 0]), 1e-3, 0.5, 1.0).round(2).tolist()
        [1.0, 0.0]
    """
    least, most = positions.min(0), positions.max(0)
    cell = max(reach / CELLS_IN_REACH, (most - least).max() / MOST_CELLS)
    deviation = reach / cell
    cells = ((positions - least) / cell).astype(np.intp)
    shape = cells.max(0) + 1
    place = np.ravel_multi_index(tuple(cells.T), shape)

    def near(each: np.ndarray) -> np.ndarray:
        sums = np.bincount(place, each, int(shape.prod())).reshape(shape)
        peak_is_one = max(np.sqrt(2 * np.pi) * deviation, 1) ** 3  # a reach within one cell blurs nothing
        return gaussian_filter(sums, deviation, mode="constant", truncate=3).ravel()[place] * peak_is_one

    return (near(part) + prior * expected) / (near(weight) + prior)
