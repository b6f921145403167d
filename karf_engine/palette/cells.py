"""Histograms of colors: the occupied cells of the color cube, their mean colors and counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def color_cells(pixels: np.ndarray, bits: int = 5, drop: float = 0.0005) -> tuple[np.ndarray, np.ndarray]:
    """Mean color [c, 3] and number of pixels [c] of each occupied cell of a histogram with 2^bits bins a channel.

    pixels: [n, 3] sRGB in [0, 1]. The rarest cells that together hold at most the share `drop` of the pixels are left
    out. Order: by position in the histogram.
    """
    pixels = np.asarray(pixels)
    index = cell_index(pixels, bits)
    occupied, inverse, counts = np.unique(index, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(inverse, pixels[:, c], len(occupied)) for c in range(3)], axis=1) / counts[:, None]
    rarest_first = np.argsort(counts, kind="stable")
    dropped = rarest_first[: np.searchsorted(counts[rarest_first].cumsum(), drop * len(pixels), side="right")]
    keep = np.ones(len(occupied), bool)
    keep[dropped] = False
    return means[keep], counts[keep]


def cell_support(cells: np.ndarray, views: Sequence[np.ndarray], bits: int = 5) -> np.ndarray:
    """In how many views each cell [c, 3] occurs, [c]; views: each one's object pixels [n, 3] sRGB in [0, 1]."""
    support = np.zeros(2 ** (3 * bits), np.int64)
    for pixels in views:
        support[np.unique(cell_index(pixels, bits))] += 1
    return support[cell_index(cells, bits)]


def cell_index(pixels: np.ndarray, bits: int) -> np.ndarray:
    bins = 2**bits
    red, green, blue = np.clip((np.asarray(pixels) * bins).astype(np.int64), 0, bins - 1).T
    return (red * bins + green) * bins + blue
