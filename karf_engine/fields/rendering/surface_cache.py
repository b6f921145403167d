"""Quantile samples: K samples per ray that represent all of its samples.

Geometry is frozen after its stage, so ray weights are constants. Later stages only keep the samples at the K
mid-quantiles of each ray's weights (K = 3: at 1/6, 3/6 and 5/6), each with weight opacity / K. The final transmittance
belongs to the background class and to the black palette entry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import torch
from torch import Tensor

from ...compute.cores import parallel_for
from ...compute.precision import to_float64
from ...compute.progress import Progress
from .rays import Rays
from .sampling import Samples

Part = TypeVar("Part")
RAYS_PER_CHUNK = 4096
MIN_OPACITY = 0.02  # rays below it have no samples


@dataclass(frozen=True)
class SurfaceCache:
    """Quantile samples of n rays, those with an opacity above MIN_OPACITY."""

    positions: Tensor  # [n, K, 3], grid coordinates
    distances: Tensor  # [n, K], grid units, from where the ray enters the grid
    viewdirs: Tensor  # [n, 3], unit directions in the world
    opacity: Tensor  # [n] in [0, 1]
    index: Tensor  # [n], index of each ray among all given rays

    def __len__(self) -> int:
        return len(self.opacity)

    @property
    def spread(self) -> Tensor:
        """The distance from the first to the last sample of each ray, [n], grid units."""
        return self.distances[:, -1] - self.distances[:, 0]

    def subsample(self, n_samples: int) -> SurfaceCache:
        """Reduce the samples to at most n_samples >= 1 per ray, at the mid-quantiles of fewer shares."""
        n_kept = self.positions.shape[1]
        if n_kept <= n_samples:
            return self
        chosen = [int((number + 0.5) / n_samples * n_kept) for number in range(n_samples)]
        return replace(self, positions=self.positions[:, chosen], distances=self.distances[:, chosen])


@torch.no_grad()
def cache_surface(field, rays: Rays, n_samples: int, step: float, progress: Progress | None = None) -> SurfaceCache:
    """Compute the K = `n_samples` >= 1 quantile samples of rays, in world units, through a frozen field.

    Not differentiable. The field is any object with the method `trace` of `fields.protocol.Field`, `step` its stride.
    `progress` receives the number of rays at the end; it may raise Cancelled.
    """

    def cache(chunk: Rays, first: int) -> SurfaceCache:
        trace = field.trace(chunk, step)
        return quantile_samples(chunk, trace.samples, trace.ray_weights, n_samples, first)

    parts = map_chunks(cache, rays, RAYS_PER_CHUNK)
    if progress is not None:
        progress.step(len(rays))
    return concatenate_caches(parts)


def map_chunks(function: Callable[[Rays, int], Part], rays: Rays, size: int) -> list[Part]:
    """Apply a function of some rays and the index of their first one to all rays, `size` at a time, on all cores."""
    starts, parts = range(0, len(rays), size), {}

    def apply(first: int, last: int) -> None:
        for start in starts[first:last]:
            parts[start] = function(rays[start : start + size], start)

    parallel_for(apply, len(starts))
    return [parts[start] for start in starts]


def concatenate_caches(parts: list[SurfaceCache]) -> SurfaceCache:
    """Concatenate caches (at least one) with the same K. Their `index` stays as it is."""
    return SurfaceCache(*[torch.cat([getattr(part, item.name) for part in parts]) for item in fields(SurfaceCache)])


@torch.no_grad()
def quantile_samples(rays: Rays, samples: Samples, ray_weights: Tensor, n_samples: int, first: int = 0) -> SurfaceCache:
    """Select the packed samples at the K mid-quantiles of each ray's weights [S]. `first` is added to `index`.

    Not differentiable.
    """
    n_rays, mass = len(rays), torch.cumsum(to_float64(ray_weights), 0)
    ray_indices = samples.ray_indices.to(mass.device)
    counts = torch.bincount(ray_indices, minlength=n_rays)
    end = torch.cumsum(counts, 0)
    padded = torch.cat([mass.new_zeros(1), mass])
    mass_before, opacity = padded[end - counts], padded[end] - padded[end - counts]
    kept = torch.nonzero(opacity > MIN_OPACITY).squeeze(1)

    # one sorted key for all rays: ray number + cumulative share of the ray's opacity
    share = (mass - mass_before[ray_indices]) / opacity[ray_indices].clamp_min(1e-12)
    key = ray_indices + share.clamp(0, 1 - 1e-9)
    quantiles = (torch.arange(n_samples, device=key.device) + 0.5) / n_samples
    chosen = torch.searchsorted(key, kept[:, None] + quantiles)
    # rounding may lead past the ray's last sample
    chosen = torch.minimum(chosen, end[kept, None] - 1)
    chosen, kept, opacity = (part.to(ray_weights.device) for part in (chosen, kept, opacity[kept].float()))
    positions, distances = samples.positions[chosen], samples.distances[chosen]
    return SurfaceCache(positions, distances, rays.viewdirs[kept], opacity, kept + first)
