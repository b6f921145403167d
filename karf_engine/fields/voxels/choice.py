"""Which renderer learns a field: the compiled kernels where they run, torch everywhere else."""

from __future__ import annotations

import os
from importlib.util import find_spec

from ...runtime import Runtime
from .field import VoxelField
from .renderer import Observing, Renderer
from .torch_renderer import TorchRenderer

MOST_VERTICES = 2**31 - 1  # that kernels number


def new_renderer(field: VoxelField, runtime: Runtime, unit: float, lottery: float, observing: Observing) -> Renderer:
    """A renderer of this field.

    Args:
        field: Of any device.
        runtime: Where to compute, and the source of random numbers.
        unit: Length in which distances along rays are summed up, grid units.
        lottery: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        observing: How exactly rays observe points.
    """
    if not (has_kernels() and runtime.device.type == "cpu" and field.vertex_rows.numel() <= MOST_VERTICES):
        return TorchRenderer(field, runtime, unit, lottery, observing)
    from .fused.renderer import FusedRenderer  # numba may be missing

    return FusedRenderer(field, runtime, unit, lottery, observing)


def has_kernels() -> bool:
    """Whether numba is there, and not left out by the variable KARF_KERNELS=off."""
    return os.environ.get("KARF_KERNELS", "on") != "off" and find_spec("numba") is not None
