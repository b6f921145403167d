"""Whether the compiled kernels (fused/) can compute a field."""

from __future__ import annotations

from torch import Tensor

from ...kernels import has_kernels
from .vertices import BITS

MOST_VERTICES = 2**31 - 1  # that kernels can number


def suit_kernels(index: Tensor) -> bool:
    """Whether kernels can compute the field with this index of vertices (see vertices.py)."""
    return index.device.type == "cpu" and BITS * index.numel() <= MOST_VERTICES and has_kernels()
