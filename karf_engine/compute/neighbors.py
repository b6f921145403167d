"""Nearest-neighbor trees in processes that flush denormal numbers to zero."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]


def build_kd_tree(positions: np.ndarray, **options: bool) -> cKDTree:
    """Build a k-d tree of finite positions [n, D] with denormal numbers enabled; options are those of `cKDTree`.

    SciPy may split at the denormal number next to a coordinate of 0; flushed to zero, the split recurses endlessly.
    """
    are_flushed = math.ulp(0.0) * 1.0 == 0.0  # in this thread
    torch.set_flush_denormal(False)
    try:
        return cKDTree(positions, **options)
    finally:
        torch.set_flush_denormal(are_flushed)
