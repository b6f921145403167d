"""Trees that find nearest neighbors, built where denormal numbers are flushed to zero."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.spatial import cKDTree


def tree_of(positions: np.ndarray, **options: bool) -> cKDTree:
    """The tree of positions.

    SciPy splits points whose least coordinate is 0 at the number next to it, which is denormal. Flushed to zero it splits
    nothing, and the process ends in an endless recursion. So denormal numbers are kept while a tree is built.

    Args:
        positions: [n, D], finite.
        options: Of `scipy.spatial.cKDTree`.

    Examples:
        >>> tree = tree_of(np.array([[0.0, 0.0], [3.0, 4.0]]))
        >>> tree.query([3.0, 3.0])
        (1.0, 1)
    """
    are_flushed = math.ulp(0.0) * 1.0 == 0.0  # in this thread
    torch.set_flush_denormal(False)
    try:
        return cKDTree(positions, **options)
    finally:
        torch.set_flush_denormal(are_flushed)
