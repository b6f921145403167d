"""Differentiable rendering of a field during training: sums along rays, and the optimizer of its tables.

`TorchRenderer` runs on any device, `fused.renderer.FusedRenderer` on processors with numba. Losses are ordinary torch
expressions of the sums, the same for both.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from ..rendering.rays import Rays

DARK = 1e-4  # rays are terminated at this transmittance


@dataclass(frozen=True)
class RayBatch:
    """Rays to render."""

    rays: Rays  # R rays, world units
    step: float  # distance between samples, voxels
    jitter: Tensor  # offset of each ray's samples in [0, 1) steps, [R]
    is_diffuse: bool = False  # ignore the viewing direction
    observed: Tensor | None = None  # points observed by the last O rays, [O, 3], grid coordinates


@dataclass(frozen=True)
class RaySums:
    """Sums over the samples of each ray, differentiable in all parameters of the field."""

    color: Tensor  # weighted colors without a background, [R, 3]
    final_transmittance: Tensor  # transmittance after the last sample, [R] in [0, 1]
    distortion: Tensor  # distortion of Mip-NeRF 360 (see volume.distortion), in the renderer's unit, [R]
    before: Tensor  # weight before the observed point less the margin, [R]; 0 for rays without a valid observation
    up_to: Tensor  # weight before the observed point plus the margin, [R]; 0 for rays without a valid observation
    distance: Tensor  # weighted distances along the ray, in the renderer's unit, [R]
    distance_squared: Tensor  # weighted squared distances, [R]
    alpha: Tensor  # sum of the samples' opacities, [R]
    observes: Tensor  # rays with a valid observation, [R] bool
    n_samples: int  # samples of all rays


class Renderer(Protocol):
    """Renderer of one field during training; pruning or refining the field requires a new renderer."""

    def render(self, batch: RayBatch) -> RaySums:
        """Render a batch. Call `backward` before rendering the next one."""
        ...

    def differences(self, rows: Tensor, other_rows: Tensor) -> tuple[Tensor, Tensor]:
        """Return the sums of squared differences between table rows [m] and others [m], of densities and of features.

        Pairs with a row of -1 are skipped. Differentiable in the tables.
        """
        ...

    def optimizer(self, groups: list[dict], betas: tuple[float, float]) -> torch.optim.Optimizer:
        """Return Adam over parameter groups; the first group is the field's densities and features."""
        ...

    def visibility(self, batches: Iterable[Rays]) -> Tensor:
        """Return the largest sample weight in each occupied cell over all rays, [n]."""
        ...

    def is_free(self, rays: Rays, step: float) -> Tensor:
        """Return True for rays without a sample in an occupied cell, [R] bool. step: sample distance, voxels."""
        ...
