"""Fitting open space: scenes that extend behind the object and behind the cameras, without a background of their own.

The grid lies in a contraction or a frustum (rendering.space), and every ray ends on something. Photos alone do not say
where: fog before the cameras explains them as well, and held-out views then show it. Sparse points do: a ray to a point
is free up to it and ends at it (after DS-NeRF, Deng et al. 2022, and Urban Radiance Fields, Rematas et al. 2022).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from ...rendering.rays import PixelBank
from ...rendering.sampling import Polylines, Samples, march
from ...rendering.space import OpenSpace
from ...rendering.volume import accumulate, distortion, ray_weights_from_sigmas, remainder_from_sigmas
from ...runtime import Runtime
from ...settings import Level, OpenSettings
from ...training.course import Course
from ..background import Background
from ..extent import is_free
from .field import VoxelField
from .fit import Batch, VoxelFit
from .observations import Observations

DENSITY_BIAS = -4.5  # fog that is thick enough to be seen at once: everything in open space is opaque somewhere
ROULETTE_WEIGHT = 0.02  # samples of less are colored with a probability in proportion to it (Russian roulette)
POINT_MARGIN = 2.0  # voxels; a point's surface is looked for this far round it
LATE_POINTS = 0.25  # of their weight in the last level, where photos know better than points by some tenths of a pixel
OFF_PATH = 3.0  # voxels; an observation whose point lies farther from its own ray is a mistake
TV_VERTICES = 30_000


class OpenFit(VoxelFit):
    """The fit of open space. observations may be empty."""

    cuts = (1 / 4, 1 / 2)
    background_kind = "opaque"

    def __init__(
        self, bank: PixelBank, settings: OpenSettings, runtime: Runtime, field: VoxelField, observations: Observations
    ) -> None:
        super().__init__(bank, settings, runtime, field, fit_background(bank, runtime))
        self._observations = observations
        self._grid_size = float((field.bounds[1] - field.bounds[0]).max()) / 2

    def _learn(self, field: VoxelField, course: Course) -> None:
        super()._learn(field, course)
        self._vertices = torch.nonzero(field.vertex_rows.view(-1) >= 0).squeeze(1)

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        settings, field, runtime, bank = self.recipe, self.field, self.runtime, self.bank
        n_observed = int(n_rays * settings.point_share) if len(self._observations) else 0
        index = bank.draw(n_rays, runtime)
        if n_observed:
            chosen = runtime.randint(len(self._observations), n_observed)
            index[n_rays - n_observed :] = self._observations.index[chosen]
        rays = bank.rays(index)
        paths = field.space.paths(rays, *field.bounds)
        samples = march(
            paths, field.minimum, field.voxel, field.occupied, field.coarse, level.step, runtime.rand(n_rays)
        )
        rows, weights = field.corners(samples.positions, all_occupied=True)
        sigmas = field.density_at(rows, weights)
        ray_weights = ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices)

        chance = (ray_weights.detach() / ROULETTE_WEIGHT).clamp_max(1)
        seen = torch.nonzero(runtime.rand(len(samples)) < chance).squeeze(1)
        ray_indices, diffuse = samples.ray_indices[seen], number == 0
        features = field.features_at(rows[seen], weights[seen], diffuse)
        colors = field.color(samples.positions[seen], rays.viewdirs[ray_indices], features, diffuse)
        color = accumulate(ray_weights[seen] / chance[seen], colors, ray_indices, n_rays)
        remainder = remainder_from_sigmas(sigmas, samples.step, samples.ray_indices, n_rays)
        # behind everything it is any color, so that rays must end on something
        error = ((color + remainder[:, None] * runtime.rand(n_rays, 3) - bank.color[index].float() / 255) ** 2).mean()

        size = self._grid_size
        distortion_sum = distortion(ray_weights, samples.distances / size, samples.step / size, samples.ray_indices)
        loss = error + settings.distortion * distortion_sum / n_rays + settings.transparency * remainder.mean()
        for table in (field.raw_density, field.feature_table):
            loss = loss + settings.total_variation * self._total_variation(table)
        if n_observed:
            is_last = level is settings.levels[-1]
            strength = settings.point_depth * (LATE_POINTS if is_last else 1.0)
            loss = loss + strength * self._point_loss(paths, samples, ray_weights, chosen)
        return Batch(loss, error, len(samples))

    def _point_loss(self, paths: Tensor, samples: Samples, ray_weights: Tensor, chosen: Tensor) -> Tensor:
        """Weight before an observed point, and weight that is missing up to it; means over the last rays of the batch."""
        n_observed, voxel = len(chosen), self.field.voxel
        first = len(paths) - n_observed
        at, off = Polylines(paths[first:]).nearest(self._observations.positions[chosen])
        own = samples.ray_indices >= first
        ray_indices, distances = samples.ray_indices[own] - first, samples.distances[own]
        limit, margin = at[ray_indices], POINT_MARGIN * voxel
        weights = torch.stack([distances < limit - margin, distances < limit + margin], 1)
        before, up_to = accumulate(ray_weights[own], weights.float(), ray_indices, n_observed).unbind(1)
        return ((before + 1 - up_to) * (off < OFF_PATH * voxel)).mean()

    def _total_variation(self, table: Tensor) -> Tensor:
        """Mean squared difference to the next vertex along each axis, over random vertices."""
        flat = self.field.vertex_rows.view(-1)
        vertices = self._vertices[self.runtime.randint(len(self._vertices), TV_VERTICES)]
        steps = torch.tensor([0, *self.field.vertex_rows.stride()], device=flat.device)
        rows = flat[(vertices[:, None] + steps).clamp_max(len(flat) - 1)].long()
        # one gather of all: the gradient of each is as large as the table
        own, *neighbors = nn.functional.embedding(rows.clamp_min(0), table).unbind(1)
        exists = (rows >= 0)[..., None]
        return sum((exists[:, n] * (value - own) ** 2).mean() for n, value in enumerate(neighbors, 1))


def start_open_fit(
    bank: PixelBank,
    space: OpenSpace,
    settings: OpenSettings,
    n_features: int,
    observations: Observations,
    depths: list[float],
    runtime: Runtime,
) -> OpenFit:
    """A fresh field in all of a space, on the runtime's device, that at least two cameras see and none sees through.

    depths: up to which each of the bank's cameras sees nothing, world units.
    """
    low, high = space.grid_bounds(bank.cameras)
    voxel = float((high - low).max()) / settings.levels[0].voxels
    shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
    occupied = torch.ones(shape, dtype=torch.bool, device=runtime.device)
    cells = low + (torch.nonzero(occupied) + 0.5) * voxel
    free = is_free(space.to_world(cells).double().cpu().numpy(), bank.cameras, depths)
    occupied = (space.is_seen(cells, bank.cameras) & ~torch.from_numpy(free).to(cells.device)).view(shape)
    field = VoxelField(low, voxel, occupied, n_features, 64, DENSITY_BIAS, space)
    return OpenFit(bank, settings, runtime, field, observations)


def fit_background(bank: PixelBank, runtime: Runtime) -> Background:
    """What the photos show in each direction on average: a better filling for unseen gaps than any one color."""
    background = Background().to(runtime.device)
    optimizer = torch.optim.Adam(background.parameters(), lr=1e-2)
    for _ in range(200):
        index = bank.draw(2048, runtime)
        loss = ((background(bank.rays(index).viewdirs) - bank.color[index].float() / 255) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return background.requires_grad_(False)
