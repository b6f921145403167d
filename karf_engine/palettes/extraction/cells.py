"""Color histograms: the occupied cells of the color cube, with mean colors and counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

BITS = 5  # per channel of the histogram


def color_cells(pixels: np.ndarray, drop: float = 0.0005) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean colors [c, 3] and pixel counts [c] of the occupied cells of a histogram, in cell order.

    Args:
        pixels: [n, 3] sRGB in [0, 1].
        drop: The rarest cells with at most this share of the pixels together are left out.

    Examples:
        >>> colors, counts = color_cells(np.array([[0.5, 0, 0], [0.51, 0, 0], [0, 0, 1]]))
        >>> colors.round(3).tolist(), counts.tolist()
        ([[0.0, 0.0, 1.0], [0.505, 0.0, 0.0]], [1, 2])
    """
    pixels = np.asarray(pixels)
    index = cell_index(pixels, BITS)
    occupied, inverse, counts = np.unique(index, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(inverse, pixels[:, c], len(occupied)) for c in range(3)], axis=1) / counts[:, None]
    rarest_first = np.argsort(counts, kind="stable")
    dropped = rarest_first[: np.searchsorted(counts[rarest_first].cumsum(), drop * len(pixels), side="right")]
    keep = np.ones(len(occupied), bool)
    keep[dropped] = False
    return means[keep], counts[keep]


def cell_support(cells: np.ndarray, views: Sequence[np.ndarray]) -> np.ndarray:
    """Return in [c] the number of views that contain each cell.

    Args:
        cells: [c, 3] colors of cells, sRGB in [0, 1].
        views: Pixels of each view, [n, 3] sRGB in [0, 1].

    Examples:
        >>> red, blue = np.array([[1.0, 0, 0]]), np.array([[0, 0, 1.0]])
        >>> cell_support(np.concatenate([red, blue]), [red, np.concatenate([red, blue])]).tolist()
        [2, 1]
    """
    support = np.zeros(2 ** (3 * BITS), np.int64)
    for pixels in views:
        support[np.unique(cell_index(pixels, BITS))] += 1
    return support[cell_index(cells, BITS)]


def cell_index(pixels: np.ndarray, bits: int) -> np.ndarray:
    """Return the cell index of each color [n, 3], [n] int in [0, 8^bits): red is most significant, blue least.

    Examples:
        >>> cell_index(np.array([[0.0, 0, 0], [0, 0, 1], [1, 1, 1]]), 1).tolist()
        [0, 1, 7]
    """
    bins = 2**bits
    red, green, blue = np.clip((np.asarray(pixels) * bins).astype(np.int64), 0, bins - 1).T
    return (red * bins + green) * bins + blue


def weighted_quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """Return the value [n] whose cumulative weight [n] reaches a share of the total.

    Examples:
        >>> weighted_quantile(np.array([3.0, 1.0, 2.0]), np.array([1, 1, 8]), 0.5)
        2.0
    """
    order = np.argsort(values)
    total = weights[order].cumsum()
    return float(values[order][np.searchsorted(total, share * total[-1])])
