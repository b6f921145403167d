"""Color histograms of objects, the input of palette extraction and color matching, and object_colors.npz."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import DataError
from ..io.files import atomic_write
from ..io.npz import read_arrays

AGAIN = "Extract the palettes again."
MAX_CELLS = 2**18
BITS = 5  # per channel of a histogram


class ColorHistogram(NamedTuple):
    """Color histogram of an object: its n occupied cells."""

    colors: np.ndarray  # [n, 3], mean sRGB in [0, 1] of each cell
    counts: np.ndarray  # [n], pixels
    palette_weights: np.ndarray  # [n, M]; rows sum to 1


def color_cells(pixels: np.ndarray, drop: float = 0.0005) -> tuple[np.ndarray, np.ndarray]:
    """Return mean colors [c, 3] and counts [c] of the cells of pixels, sRGB [n, 3], without a share `drop` of the rarest."""
    pixels = np.asarray(pixels)
    index = cell_index(pixels)
    occupied, inverse, counts = np.unique(index, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(inverse, pixels[:, c], len(occupied)) for c in range(3)], axis=1) / counts[:, None]
    rarest_first = np.argsort(counts, kind="stable")
    dropped = rarest_first[: np.searchsorted(counts[rarest_first].cumsum(), drop * len(pixels), side="right")]
    keep = np.ones(len(occupied), bool)
    keep[dropped] = False
    return means[keep], counts[keep]


def cell_support(cells: np.ndarray, views: Sequence[np.ndarray]) -> np.ndarray:
    """Return the number of views, each sRGB [n, 3] in [0, 1], that contain each cell, colors [c, 3]: [c]."""
    support = np.zeros(2 ** (3 * BITS), np.int64)
    for pixels in views:
        support[np.unique(cell_index(pixels))] += 1
    return support[cell_index(cells)]


def cell_index(pixels: np.ndarray) -> np.ndarray:
    """Return the cell index [n] of colors, sRGB [n, 3] in [0, 1]: red is most significant, blue least."""
    bins = 2**BITS
    red, green, blue = np.clip((np.asarray(pixels) * bins).astype(np.int64), 0, bins - 1).T
    return (red * bins + green) * bins + blue


def weighted_quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """Return the value, of [n], where the cumulative weight [n] of the sorted values reaches a share of the total."""
    order = np.argsort(values)
    total = weights[order].cumsum()
    return float(values[order][np.searchsorted(total, share * total[-1])])


def read_object_colors(path: Path, name: str) -> ColorHistogram:
    """Read an object's color histogram; raise DataError if the file lacks it, is unreadable or has invalid values."""
    parts = [f"{name}/{part}" for part in ColorHistogram._fields]
    colors, counts, weights = read_arrays(path, parts, f"colors of {name!r}", AGAIN)
    fits = counts.ndim == 1 and colors.shape == (len(counts), 3) and weights.shape[:-1] == counts.shape
    is_sane = all(array.dtype.kind in "iuf" and np.isfinite(array).all() for array in (colors, counts, weights))
    if not (fits and is_sane and 0 < len(counts) <= MAX_CELLS and counts.min() >= 0 and counts.sum() > 0):
        raise DataError(
            f"{path} has colors {colors.shape}, counts {counts.shape} and weights {weights.shape} of {name!r}, "
            "which are not a histogram.",
            AGAIN,
        )
    return ColorHistogram(colors, counts, weights)


def write_object_colors(path: Path, histograms: Mapping[str, ColorHistogram]) -> None:
    """Write color histograms of objects by name, atomically."""
    arrays = {
        f"{name}/{part}": array for name, histogram in histograms.items() for part, array in histogram._asdict().items()
    }
    atomic_write(path, lambda temporary: np.savez_compressed(temporary, **arrays))
