"""Read and write object_colors.npz: the objects' color histograms, the input of color matching."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import DataError
from ..io.files import atomic_write
from ..io.npz import read_arrays

AGAIN = "Extract the palettes again."
MAX_CELLS = 2**18


class ColorHistogram(NamedTuple):
    """Color histogram of an object, of n occupied cells.

    Attributes:
        colors: [n, 3] mean sRGB in [0, 1] of each cell.
        counts: [n] number of pixels.
        palette_weights: [n, M] weights of each color over the M palette entries; rows sum to 1.
    """

    colors: np.ndarray
    counts: np.ndarray
    palette_weights: np.ndarray


def read_object_colors(path: Path, name: str) -> ColorHistogram:
    """Read the color histogram of an object; raise DataError if the file lacks it, is unreadable or has invalid values.

    Examples:
        >>> import tempfile
        >>> pot = ColorHistogram(np.array([[0.7, 0.2, 0.1]]), np.array([40]), np.array([[0.3, 0.7]]))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_object_colors(Path(folder) / "object_colors.npz", {"pot": pot})
        ...     read_object_colors(Path(folder) / "object_colors.npz", "pot").counts
        array([40])
    """
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
    """Write the color histograms of objects, by name, atomically.

    Examples:
        >>> import tempfile
        >>> pot = ColorHistogram(np.array([[0.7, 0.2, 0.1]]), np.array([40]), np.array([[0.3, 0.7]]))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_object_colors(Path(folder) / "object_colors.npz", {"pot": pot})
        ...     sorted(np.load(Path(folder) / "object_colors.npz"))
        ['pot/colors', 'pot/counts', 'pot/palette_weights']
    """
    arrays = {
        f"{name}/{part}": array for name, histogram in histograms.items() for part, array in histogram._asdict().items()
    }
    atomic_write(path, lambda temporary: np.savez_compressed(temporary, **arrays))
