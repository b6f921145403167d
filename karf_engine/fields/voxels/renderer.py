"""What a fit asks of the field it learns: sums along rays, and the step that their gradients lead to.

Two ways to compute them stand behind one protocol: torch, on any device, and compiled kernels (fused/), on processors
that have numba. Losses are ordinary torch on the sums of each ray, and the same for both.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from ..rendering.rays import Rays

DARK = 1e-4  # of the light left, a ray ends


@dataclass(frozen=True)
class PointSupervision:
    """How exactly rays observe points, grid units.

    Attributes:
        margin: How far before and behind an observed point its surface may lie.
        off_path: An observed point farther from its ray is a mistake.
    """

    margin: float
    off_path: float


@dataclass(frozen=True)
class RayBatch:
    """Rays to render.

    Attributes:
        rays: R of them, world units.
        step: Distance between samples, voxels.
        jitter: Offset of each ray's samples in [0, 1) steps, [R].
        is_diffuse: Whether the viewing direction is left out of the colors.
        observed: Points that the last O rays observe, [O, 3], grid coordinates; None for none.
    """

    rays: Rays
    step: float
    jitter: Tensor
    is_diffuse: bool = False
    observed: Tensor | None = None


@dataclass(frozen=True)
class RaySums:
    """Sums over the samples of each ray, differentiable in all that is learned of the field.

    Attributes:
        color: Weighted colors, what is behind left out, [R, 3].
        final_transmittance: Light that leaves the ray behind its last sample, [R] in [0, 1].
        distortion: Mip-NeRF 360's (volume.distortion), in the renderer's unit of length, [R].
        before: Weight clearly before the ray's observed point, [R]; 0 for rays that observe none or pass it by.
        up_to: Weight up to a little behind that point, [R], likewise.
        observes: Whether the ray observes a point and does not pass it by, [R] bool.
        distance: Weighted distances along the ray, in that unit, [R].
        distance_squared: Weighted squares of them, [R].
        alpha: Opacities of its samples, [R].
        n_samples: Of all rays together.
    """

    color: Tensor
    final_transmittance: Tensor
    distortion: Tensor
    before: Tensor
    up_to: Tensor
    observes: Tensor
    distance: Tensor
    distance_squared: Tensor
    alpha: Tensor
    n_samples: int


class Renderer(Protocol):
    """Renders one field while it learns. A field of other cells takes another renderer."""

    def render(self, batch: RayBatch) -> RaySums:
        """The sums of a batch; `backward` must reach them before the next batch is rendered."""

    def differences(self, rows: Tensor, other_rows: Tensor) -> tuple[Tensor, Tensor]:
        """Sums of squared differences between table rows [m] and others [m], of densities and of features, []; pairs
        with a row of -1 count nothing. Differentiable in the tables."""

    def optimizer(self, groups: list[dict], betas: tuple[float, float]) -> torch.optim.Optimizer:
        """Adam over groups of parameters, of which the first holds the field's densities and features."""

    def visibility(self, batches: Iterable[Rays]) -> Tensor:
        """Largest weight of a sample in each occupied cell, over the rays of all batches, [n]."""

    def is_free(self, rays: Rays, step: float) -> Tensor:
        """Whether a ray meets no occupied cell, by samples so many voxels apart, [R] bool."""
