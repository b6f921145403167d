"""Fitting open space: scenes that go on behind the object and behind the cameras, without a background of their own.

The grid lies in a contraction or a frustum (rendering.space), and every ray ends on something. Photos alone do not say
where: fog before the cameras explains them as well, and held-out views then show it. Sparse points do: a ray to a point
is free up to it and ends at it (after DS-NeRF, Deng et al. 2022, and Urban Radiance Fields, Rematas et al. 2022).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from ...capture.camera import Camera
from ...rendering.rays import PixelBank, camera_rays
from ...rendering.sampling import Polylines, Samples, march
from ...rendering.space import Contraction, Frustum, Space
from ...rendering.volume import accumulate, distortion, ray_weights_from_sigmas, remainder_from_sigmas
from ...runtime import Runtime
from ...settings import Level, OpenSettings
from ...training.course import Course
from .field import Background, VoxelField
from .fit import Batch, Fit

DENSITY_BIAS = -4.5  # fog that is thick enough to be seen at once: everything in open space is opaque somewhere
SURE_WEIGHT = 0.02  # fainter samples are given a color by lot, in proportion to their weight
POINT_MARGIN = 2.0  # voxels; a point's surface is looked for this far round it
LATE_POINTS = 0.25  # of their weight in the last level, where photos know better than points by some tenths of a pixel
OFF_PATH = 3.0  # voxels; an observation whose point lies farther from its own ray is a mistake
TV_VERTICES = 30_000
MIN_VIEWS = 2


@dataclass(frozen=True)
class Sightings:
    """Which pixel sees which point. index: [m] running pixel index of a PixelBank; positions: [m, 3] grid coordinates."""

    index: Tensor
    positions: Tensor

    def __len__(self) -> int:
        return len(self.index)


class OpenFit(Fit):
    """The fit of open space. sightings may be empty."""

    cuts = (1 / 4, 1 / 2)
    kind = "opaque"

    def __init__(
        self, bank: PixelBank, settings: OpenSettings, runtime: Runtime, field: VoxelField, sightings: Sightings
    ) -> None:
        super().__init__(bank, settings, runtime, field, fit_background(bank, runtime))
        self._sightings = sightings
        self._grid_size = float((field.bounds[1] - field.bounds[0]).max()) / 2

    def _learn(self, field: VoxelField, course: Course) -> None:
        super()._learn(field, course)
        self._vertices = torch.nonzero(field.vertex_rows.view(-1) >= 0).squeeze(1)

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        settings, field, runtime, bank = self.recipe, self.field, self.runtime, self.bank
        n_sighted = int(n_rays * settings.point_share) if len(self._sightings) else 0
        index = bank.draw(n_rays, runtime)
        if n_sighted:
            chosen = runtime.randint(len(self._sightings), n_sighted)
            index[n_rays - n_sighted :] = self._sightings.index[chosen]
        rays = bank.rays(index)
        paths = field.space.paths(rays, *field.bounds)
        samples = march(
            paths, field.minimum, field.voxel, field.occupied, field.coarse, level.step, runtime.rand(n_rays)
        )
        rows, weights = field.corners(samples.positions, all_occupied=True)
        sigmas = field.density_at(rows, weights)
        ray_weights = ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices)

        chance = (ray_weights.detach() / SURE_WEIGHT).clamp_max(1)
        seen = torch.nonzero(runtime.rand(len(samples)) < chance).squeeze(1)
        ray_indices, diffuse = samples.ray_indices[seen], number == 0
        features = field.features_at(rows[seen], weights[seen], diffuse)
        colors = field.color(samples.positions[seen], rays.viewdirs[ray_indices], features, diffuse)
        color = accumulate(ray_weights[seen] / chance[seen], colors, ray_indices, n_rays)
        remainder = remainder_from_sigmas(sigmas, samples.step, samples.ray_indices, n_rays)
        # behind everything it is any color, so that rays must end on something
        error = ((color + remainder[:, None] * runtime.rand(n_rays, 3) - bank.color[index].float() / 255) ** 2).mean()

        size = self._grid_size
        spread = distortion(ray_weights, samples.distances / size, samples.step / size, samples.ray_indices)
        loss = error + settings.distortion * spread / n_rays + settings.transparency * remainder.mean()
        for table in (field.raw_density, field.feature_table):
            loss = loss + settings.total_variation * self._total_variation(table)
        if n_sighted:
            is_last = level is settings.levels[-1]
            strength = settings.point_depth * (LATE_POINTS if is_last else 1.0)
            loss = loss + strength * self._point_loss(paths, samples, ray_weights, chosen)
        return Batch(loss, error, len(samples))

    def _point_loss(self, paths: Tensor, samples: Samples, ray_weights: Tensor, chosen: Tensor) -> Tensor:
        """Weight before a sighted point, and weight that is missing up to it; means over the last rays of the batch."""
        n_sighted, voxel = len(chosen), self.field.voxel
        first = len(paths) - n_sighted
        at, off = Polylines(paths[first:]).nearest(self._sightings.positions[chosen])
        own = samples.ray_indices >= first
        ray_indices, distances = samples.ray_indices[own] - first, samples.distances[own]
        limit, margin = at[ray_indices], POINT_MARGIN * voxel
        weights = torch.stack([distances < limit - margin, distances < limit + margin], 1)
        before, up_to = accumulate(ray_weights[own], weights.float(), ray_indices, n_sighted).unbind(1)
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
    bank: PixelBank, space: Space, settings: OpenSettings, n_features: int, sightings: Sightings, runtime: Runtime
) -> OpenFit:
    """A fresh field in all of a space, on the runtime's device, that at least two cameras see."""
    low, high = grid_corners(space, bank.cameras)
    voxel = float((high - low).max()) / settings.levels[0].voxels
    shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
    occupied = torch.ones(shape, dtype=torch.bool, device=runtime.device)
    cells = low + (torch.nonzero(occupied) + 0.5) * voxel
    occupied = seen_cells(space, cells, bank.cameras).view(shape)
    field = VoxelField(low, voxel, occupied, n_features, 64, DENSITY_BIAS, space)
    return OpenFit(bank, settings, runtime, field, sightings)


def grid_corners(space: Space, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
    """Lowest and highest corner [3] of the grid: all of a contraction, and of a frustum what the cameras see."""
    if isinstance(space, Contraction):
        reach = 1 + space.room
        return torch.full_like(space.center, -reach), torch.full_like(space.center, reach)
    device, ends = space.focal.device, []
    farthest = torch.full((3,), torch.inf, device=device)
    for camera in cameras:
        corners = [0, camera.width - 1, (camera.height - 1) * camera.width, camera.height * camera.width - 1]
        rays = camera_rays(camera, device)[corners]
        ends.append(space.paths(rays, -farthest, farthest).reshape(-1, 3))
    ends = torch.cat(ends)
    low, high = ends.amin(0), ends.amax(0)
    low[2], high[2] = -space.depth_scale, space.depth_scale
    return low, high


def seen_cells(space: Space, cells: Tensor, cameras: list[Camera]) -> Tensor:
    """True for the cell centers [n, 3], grid coordinates, that at least two cameras see."""
    if isinstance(space, Frustum):
        return torch.ones(len(cells), dtype=torch.bool, device=cells.device)
    world = space.to_world(cells).double().cpu().numpy()
    n_seen = np.zeros(len(world), int)
    for camera in cameras:
        pixels, depth = camera.project(world)
        size = np.array([camera.width, camera.height])
        n_seen += (depth > 0) & ((pixels > -0.02 * size) & (pixels < 1.02 * size)).all(1)
    inside = torch.linalg.norm(cells, dim=1) < 1 + space.room
    return torch.from_numpy(n_seen >= MIN_VIEWS).to(cells.device) & inside


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
