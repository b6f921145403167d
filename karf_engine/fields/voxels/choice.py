"""Which renderer learns a field: the compiled kernels where they run, torch everywhere else."""

from __future__ import annotations

import time
from collections.abc import Callable

import torch

from ...compute.kernels import has_kernels
from ...compute.progress import Emit
from ...compute.runtime import Runtime
from ...project.settings import GeometrySettings
from .field import VoxelField
from .renderer import PointSupervision, Renderer
from .torch_renderer import TorchRenderer


def new_renderer(
    field: VoxelField, runtime: Runtime, unit: float, russian_roulette: float, supervision: PointSupervision
) -> Renderer:
    """A renderer of this field.

    Args:
        field: Of any device.
        runtime: Where to compute, and the source of random numbers.
        unit: Length in which distances along rays are summed up, grid units.
        russian_roulette: Samples of less weight get a color with a probability in proportion to it; 0 for none.
        supervision: How exactly rays observe points.
    """
    if field.suits_kernels:
        from .fused.renderer import FusedRenderer  # needs numba

        return FusedRenderer(field, runtime, unit, russian_roulette, supervision)
    return TorchRenderer(field, runtime, unit, russian_roulette, supervision)


def prepare_kernels(settings: GeometrySettings, device: torch.device) -> Callable[[Emit, Callable[[], bool]], None]:
    """Begin to compile what a fit will call, in a process beside.

    Returns:
        Call it to wait for that, with a message, until it is done or should be no longer.
    """
    if device.type != "cpu" or not has_kernels():
        return lambda emit, should_stop: None
    from .fused.preparing import begin  # needs numba

    process = begin(settings.features)

    def wait(emit: Emit, should_stop: Callable[[], bool]) -> None:
        if process is None:
            return
        if process.poll() is None:
            emit("stage", name="geometry", text="compiling for this processor, once: up to a minute")
        while process.poll() is None and not should_stop():
            time.sleep(0.1)
        if process.poll() is None:
            process.kill()

    return wait
