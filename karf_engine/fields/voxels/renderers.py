"""Selection of the renderer for training: compiled kernels where numba runs, torch elsewhere."""

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
    """Return a renderer for training this field.

    Args:
        field: Field to train.
        runtime: Device and source of random numbers.
        unit: Unit of the summed distances, grid units.
        russian_roulette: Samples below this weight get a color with a probability proportional to it; 0 turns it off.
        supervision: Tolerances for observed points.
    """
    if field.suits_kernels:
        from .fused.renderer import FusedRenderer  # needs numba

        return FusedRenderer(field, runtime, unit, russian_roulette, supervision)
    return TorchRenderer(field, runtime, unit, russian_roulette, supervision)


def prepare_kernels(settings: GeometrySettings, device: torch.device) -> Callable[[Emit, Callable[[], bool]], None]:
    """Start compiling the kernels of a fit in another process.

    Returns:
        A function (emit, should_stop) that waits for the compilation and emits a message if it is still running.
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
