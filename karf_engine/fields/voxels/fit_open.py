"""Fitting open space: scenes that extend behind the object and behind the cameras, without a background of their own.

The grid lies in a contraction or a frustum (rendering.space), and every ray ends on something. Photos alone do not say
where: fog before the cameras explains them as well, and held-out views then show it. Sparse points do: a ray to a point
is free up to it and ends at it (after DS-NeRF, Deng et al. 2022, and Urban Radiance Fields, Rematas et al. 2022).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...rendering.rays import PixelBank
from ...rendering.space import OpenSpace
from ...runtime import Runtime
from ...settings import Level, OpenSettings
from ...training.adam import Adam
from ...training.course import Course
from ..background import Background
from ..extent import is_free
from .field import VoxelField
from .fit import Batch, VoxelFit
from .observations import Observations
from .renderer import RayBatch, Renderer

DENSITY_BIAS = -4.5  # fog that is thick enough to be seen at once: everything in open space is opaque somewhere
LATE_POINTS = 0.25  # of their weight in the last level, where photos know better than points by some tenths of a pixel
TV_VERTICES = 30_000


class OpenFit(VoxelFit):
    """The fit of open space. observations may be empty."""

    cuts = (1 / 4, 1 / 2)
    lottery = 0.02
    background_kind = "opaque"

    def __init__(
        self, bank: PixelBank, settings: OpenSettings, runtime: Runtime, field: VoxelField, observations: Observations
    ) -> None:
        super().__init__(bank, settings, runtime, field, fit_background(bank, runtime))
        self._observations = observations

    def _learn(self, field: VoxelField, renderer: Renderer, course: Course) -> None:
        super()._learn(field, renderer, course)
        self._vertices = torch.nonzero(field.vertex_rows.view(-1) >= 0).squeeze(1)

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        settings, runtime, bank = self.recipe, self.runtime, self.bank
        n_observed = int(n_rays * settings.point_share) if len(self._observations) else 0
        index = bank.draw(n_rays, runtime)
        chosen = runtime.randint(max(1, len(self._observations)), n_observed)
        index[n_rays - n_observed :] = self._observations.index[chosen]
        jitter, observed = runtime.rand(n_rays), self._observations.positions[chosen]
        sums = self._renderer.render(RayBatch(bank.rays(index), level.step, jitter, number == 0, observed))
        # behind everything it is any color, so that rays must end on something
        color = sums.color + sums.remainder[:, None] * runtime.rand(n_rays, 3)
        error = ((color - bank.color[index].float() / 255) ** 2).mean()
        loss = error + settings.distortion * sums.distortion.mean() + settings.transparency * sums.remainder.mean()
        loss = loss + settings.total_variation * self._total_variation()
        if n_observed:
            strength = settings.point_depth * (LATE_POINTS if level is settings.levels[-1] else 1.0)
            # weight before an observed point, and weight that is missing up to it
            missed = (sums.before + 1 - sums.up_to) * sums.observes
            loss = loss + strength * missed.sum() / n_observed
        return Batch(loss, error, sums.n_samples)

    def _total_variation(self) -> Tensor:
        """Mean squared difference to the next vertex along each axis, over random vertices."""
        flat = self.field.vertex_rows.view(-1)
        vertices = self._vertices[self.runtime.randint(len(self._vertices), TV_VERTICES)]
        steps = torch.tensor(self.field.vertex_rows.stride(), device=flat.device)
        neighbors = flat[(vertices + steps[:, None]).clamp_max(len(flat) - 1)]
        density, features = self._renderer.differences(flat[vertices].repeat(3), neighbors.view(-1))
        return (density + features / self.field.n_features) / TV_VERTICES


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
    optimizer = Adam(background.parameters(), lr=1e-2)
    for _ in range(200):
        index = bank.draw(2048, runtime)
        loss = ((background(bank.rays(index).viewdirs) - bank.color[index].float() / 255) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return background.requires_grad_(False)
