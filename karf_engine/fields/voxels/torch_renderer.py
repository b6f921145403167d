"""`Renderer` in plain torch: runs on any device, reference for the compiled kernels."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from ...compute.runtime import Runtime
from ..rendering.rays import Rays
from ..rendering.sampling import Polylines, Samples
from ..rendering.volume import (
    VISIBLE_WEIGHT,
    accumulate,
    distortion,
    final_transmittance_from_sigmas,
    ray_weights_from_sigmas,
    transmittance_from_optical_depths,
)
from ..training import Adam
from .field import VoxelField
from .renderer import DARK, PointSupervision, RayBatch, RaySums


class TorchRenderer:
    """Renderer of one field on its own device (see choice.new_renderer)."""

    def __init__(
        self, field: VoxelField, runtime: Runtime, unit: float, russian_roulette: float, supervision: PointSupervision
    ) -> None:
        self.field, self.runtime = field, runtime
        self._unit, self._russian_roulette, self._supervision = unit, russian_roulette, supervision

    def optimizer(self, groups: list[dict], betas: tuple[float, float]) -> Adam:
        return Adam(groups, betas=betas, eps=1e-12, fused=True)

    def render(self, batch: RayBatch) -> RaySums:
        field, rays, n_rays = self.field, batch.rays, len(batch.rays)
        paths = field.space.paths(rays, *field.bounds)
        samples, rows, corner_weights = self._lit_samples(paths, batch)
        step = samples.step
        assert isinstance(step, float)  # marching takes equal steps
        sigmas = field.density_at(rows, corner_weights)
        weights = ray_weights_from_sigmas(sigmas, step, samples.ray_indices)
        importances = self._importances(weights.detach())
        colored = torch.nonzero(importances).squeeze(1)
        ray_indices = samples.ray_indices[colored]
        features = field.features_at(rows[colored], corner_weights[colored], batch.is_diffuse)
        colors = field.color(samples.positions[colored], rays.viewdirs[ray_indices], features, batch.is_diffuse)
        scaled = samples.distances / self._unit
        moments = accumulate(weights, torch.stack([scaled, scaled**2], 1), samples.ray_indices, n_rays)
        alphas = -torch.expm1(-sigmas * step)
        before, up_to, observes = self._observed(batch, paths, samples, weights)
        color = accumulate(weights[colored] * importances[colored], colors, ray_indices, n_rays)
        final_transmittance = final_transmittance_from_sigmas(sigmas, step, samples.ray_indices, n_rays)
        spread = distortion(weights, scaled, step / self._unit, samples.ray_indices, n_rays)
        alpha = accumulate(alphas, None, samples.ray_indices, n_rays)[:, 0]
        distance, distance_squared = moments[:, 0], moments[:, 1]
        return RaySums(
            color, final_transmittance, spread, before, up_to, observes, distance, distance_squared, alpha, len(samples)
        )

    @torch.no_grad()
    def _lit_samples(self, paths: Tensor, batch: RayBatch) -> tuple[Samples, Tensor, Tensor]:
        """Return the samples in front of the termination of each ray, with their corner rows and weights."""
        field = self.field
        samples = field.march_paths(paths, batch.step, batch.jitter)
        rows, corner_weights = field.corners(samples.positions, all_occupied=True)
        optical_depths = field.density_at(rows, corner_weights) * samples.step
        transmittance = transmittance_from_optical_depths(optical_depths, samples.ray_indices)
        lit = torch.nonzero(transmittance > DARK).squeeze(1)
        kept = Samples(samples.ray_indices[lit], samples.distances[lit], samples.positions[lit], samples.step)
        return kept, rows[lit], corner_weights[lit]

    def _importances(self, weights: Tensor) -> Tensor:
        """Return 1 / p for samples drawn with probability p (Russian roulette), 0 for the others, [S]."""
        if not self._russian_roulette:
            return (weights > VISIBLE_WEIGHT).to(weights.dtype)
        chance = (weights / self._russian_roulette).clamp_max(1)
        return torch.where(self.runtime.rand(len(weights)) < chance, 1 / chance, torch.zeros_like(chance))

    def _observed(
        self, batch: RayBatch, paths: Tensor, samples: Samples, weights: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return `before`, `up_to` and `observes` of RaySums."""
        n_rays, none = len(paths), torch.zeros(len(paths), device=paths.device)
        if batch.observed is None or not len(batch.observed):
            return none, none, none > 0
        first = n_rays - len(batch.observed)
        distance, gap = Polylines(paths[first:]).nearest(batch.observed)
        reach = torch.full_like(none, -1.0)
        reach[first:] = torch.where(gap < self._supervision.off_path, distance, torch.full_like(distance, -1.0))
        limit, margin = reach[samples.ray_indices], self._supervision.margin
        nearer = torch.stack([samples.distances < limit - margin, samples.distances < limit + margin], 1)
        before, up_to = accumulate(weights, nearer & (limit >= 0)[:, None], samples.ray_indices, n_rays).unbind(1)
        return before, up_to, reach >= 0

    def differences(self, rows: Tensor, other_rows: Tensor) -> tuple[Tensor, Tensor]:
        exists = ((rows >= 0) & (other_rows >= 0))[:, None]
        both = torch.stack([rows, other_rows]).long().clamp_min(0)

        def squares(table: Tensor) -> Tensor:
            # one gather for both: its gradient is as large as the table
            one, other = nn.functional.embedding(both, table)
            return (exists * (one - other) ** 2).sum()

        return squares(self.field.raw_density), squares(self.field.feature_table)

    @torch.no_grad()
    def visibility(self, batches: Iterable[Rays]) -> Tensor:
        field = self.field
        visibility = torch.zeros(field.occupied.numel(), device=field.occupied.device)
        for rays in batches:
            trace = field.trace(rays, 1.0)
            visibility.scatter_reduce_(0, field.cells(trace.samples.positions), trace.ray_weights, "amax")
        return visibility[field.occupied.view(-1)]

    @torch.no_grad()
    def is_free(self, rays: Rays, step: float) -> Tensor:
        free = torch.ones(len(rays), dtype=torch.bool, device=rays.origins.device)
        free[self.field.march(rays, step).ray_indices] = False
        return free
