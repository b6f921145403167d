"""Which renderer learns a field: the compiled kernels where they run, torch everywhere else."""

from __future__ import annotations

import os

from ...runtime import Runtime
from .field import VoxelField
from .renderer import Observing, Renderer
from .torch_renderer import TorchRenderer

MOST_VERTICES = 2**31 - 1  # that kernels can number


def new_renderer(field: VoxelField, runtime: Runtime, unit: float, lottery: float, observing: Observing) -> Renderer:
    """A renderer of this field.

    Args:
        field: Of any device.
        runtime: Where to compute, and the source of random numbers.
        unit: Length in which distances along rays are summed up, grid units.
        lottery: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        observing: How exactly rays observe points.
    """
    if runtime.device.type == "cpu" and field.vertex_rows.numel() <= MOST_VERTICES and has_kernels():
        from .fused.renderer import FusedRenderer  # needs numba

        return FusedRenderer(field, runtime, unit, lottery, observing)
    return TorchRenderer(field, runtime, unit, lottery, observing)


def has_kernels() -> bool:
    """Whether numba is there and loads, and is not left out by the variable KARF_KERNELS=off."""
    if os.environ.get("KARF_KERNELS", "on") == "off":
        return False
    try:
        import numba  # noqa: F401
    except (ImportError, OSError):  # not there, or not made for this numpy or processor
        return False
    return True
