"""Whether the compiled kernels (fused/) run on this machine."""

from __future__ import annotations

import os

from torch import Tensor

from .vertices import BITS

MOST_VERTICES = 2**31 - 1  # that kernels can number


def has_kernels() -> bool:
    """Whether numba is there and loads, and is not left out by the variable KARF_KERNELS=off."""
    if os.environ.get("KARF_KERNELS", "on") == "off":
        return False
    try:
        import numba  # noqa: F401
    except (ImportError, OSError):  # not there, or not made for this numpy or processor
        return False
    return True


def suit_kernels(index: Tensor) -> bool:
    """Whether kernels can compute the field with this index of vertices (see vertices.py)."""
    return index.device.type == "cpu" and BITS * index.numel() <= MOST_VERTICES and has_kernels()
