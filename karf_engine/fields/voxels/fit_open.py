"""Fitting open space: scenes that extend behind the object and behind the cameras, without a background of their own.

The grid lies in a contraction or a frustum (rendering.space), and every ray ends on something. Photos alone do not say
where: fog before the cameras explains them as well, and held-out views then show it. Sparse points do: a ray to a point
is free up to it and ends at it (after DS-NeRF, Deng et al. 2022, and Urban Radiance Fields, Rematas et al. 2022).
Above them lies the sky, a function of direction alone, before which opacity costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from ...compute.runtime import Runtime
from ...project.settings import Level, OpenSettings
from ..background import Background
from ..free_space import FreeSpace
from ..horizon import Horizon
from ..rendering.rays import PixelDataset
from ..rendering.space import OpenSpace
from ..training.adam import Adam
from ..training.state import TrainingState
from .field import VoxelField
from .fit import Batch, VoxelFit
from .observations import Observations
from .renderer import RayBatch, Renderer
from .vertices import BITS

DENSITY_BIAS = -4.5  # fog that is thick enough to be seen at once: everything in open space is opaque somewhere
LATE_POINTS = 0.25  # of their weight in the last level, where photos know better than points by some tenths of a pixel
TV_VERTICES = 30_000
CARVED = 256  # cells along the longest side, up to which those of each level are asked whether they are free
SKY_PIXELS, FEWEST_SKY_PIXELS = 200_000, 200  # of all photos that are looked at; above the horizon
AGREEING, SKY_LIKENESS = 0.8, 0.11  # share of what photos show above the horizon; its difference from a sky, a channel
FOG_PENALTY = 5e-2  # weight of opacity before a sky that shows the photo's color by itself
ALIKE = 0.2  # standard deviation of a photo's color from the sky that it shows: clouds move


class OpenFit(VoxelFit):
    """The fit of open space. observations may be empty; horizon: above which there is a sky, None for nowhere."""

    cuts = (1 / 4, 1 / 2)
    russian_roulette = 0.02
    background_kind = "opaque"

    def __init__(
        self,
        dataset: PixelDataset,
        settings: OpenSettings,
        runtime: Runtime,
        field: VoxelField,
        observations: Observations,
        free: FreeSpace,
        horizon: Horizon | None,
    ) -> None:
        background = fit_background(dataset, runtime)
        sky = None if horizon is None else fit_sky(dataset, horizon, runtime)
        super().__init__(dataset, settings, runtime, field, sky or background)
        self._observations, self._free = observations, free
        self._horizon = None if sky is None else horizon

    def _refined(self, level: Level) -> VoxelField:
        field = self.field
        if level.voxels > CARVED:
            return super()._refined(level)
        return field.refined(level.voxels, lambda cells: ~self._free.holds(field.space.to_world(cells)))

    def _learn(self, field: VoxelField, renderer: Renderer, training_state: TrainingState) -> None:
        super()._learn(field, renderer, training_state)
        self._vertices = field.numbers()

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        settings, runtime, dataset = self.recipe, self.runtime, self.dataset
        n_observed = int(n_rays * settings.point_share) if len(self._observations) else 0
        index = dataset.draw(n_rays, runtime)
        chosen = runtime.randint(max(1, len(self._observations)), n_observed)
        index[n_rays - n_observed :] = self._observations.index[chosen]
        jitter, observed = runtime.rand(n_rays), self._observations.positions[chosen]
        rays, target = dataset.rays(index), dataset.exposed_alike(index)
        sums = self._renderer.render(RayBatch(rays, level.step, jitter, number == 0, observed))
        # behind everything but the sky it is any color, so that rays must end on something
        behind, passing = runtime.rand(n_rays, 3), settings.transparency * sums.final_transmittance
        if self._horizon is not None:
            is_sky, sky = self._horizon.is_sky(rays.viewdirs), self.background(rays.viewdirs)
            needless = torch.exp(-((sky.detach() - target) ** 2).sum(1) / (2 * ALIKE**2))
            behind = torch.where(is_sky[:, None], sky, behind)
            passing = torch.where(is_sky, FOG_PENALTY * needless * (1 - sums.final_transmittance), passing)
        error = ((sums.color + sums.final_transmittance[:, None] * behind - target) ** 2).mean()
        loss = error + settings.distortion * sums.distortion.mean() + passing.mean()
        loss = loss + settings.total_variation * self._total_variation()
        if n_observed:
            strength = settings.point_depth * (LATE_POINTS if level is settings.levels[-1] else 1.0)
            # weight before an observed point, and weight that is missing up to it
            missed = (sums.before + 1 - sums.up_to) * sums.observes
            loss = loss + strength * missed.sum() / n_observed
        return Batch(loss, error, sums.n_samples)

    def _trained_networks(self, field: VoxelField) -> list:
        networks = super()._trained_networks(field)
        return networks if self._horizon is None else networks + list(self.background.parameters())

    def _total_variation(self) -> Tensor:
        """Mean squared difference to the next vertex along each axis, over random vertices."""
        field = self.field
        # in the order of memory, a vertex with all its neighbors: waiting for memory is most of the time
        rows = self.runtime.randint(len(self._vertices), TV_VERTICES).sort().values
        steps = field.vertex_numbers(torch.eye(3, dtype=torch.long, device=rows.device))
        last = field.index.numel() * BITS - 1
        neighbors = field.rows_of((self._vertices[rows, None] + steps).clamp_max(last))
        density, features = self._renderer.differences(rows.repeat_interleave(3), neighbors.view(-1))
        return (density + features / self.field.n_features) / TV_VERTICES


def start_open_fit(
    dataset: PixelDataset,
    space: OpenSpace,
    settings: OpenSettings,
    n_features: int,
    observations: Observations,
    free: FreeSpace,
    horizon: Horizon | None,
    runtime: Runtime,
) -> OpenFit:
    """A fresh field in all of a space, on the runtime's device, that a camera sees and that is not free.

    horizon: above which there may be a sky.
    """
    low, high = space.grid_bounds(dataset.cameras)
    voxel = float((high - low).max()) / settings.levels[0].voxels
    shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
    occupied = torch.ones(shape, dtype=torch.bool, device=runtime.device)
    cells = low + (torch.nonzero(occupied) + 0.5) * voxel
    occupied = (space.is_seen(cells, dataset.cameras) & ~free.holds(space.to_world(cells))).view(shape)
    field = VoxelField(low, voxel, occupied, n_features, 64, DENSITY_BIAS, space)
    return OpenFit(dataset, settings, runtime, field, observations, free, horizon)


def fit_background(dataset: PixelDataset, runtime: Runtime) -> Background:
    """What the photos show in each direction on average: a better filling for unseen gaps than any one color."""
    background = Background().to(runtime.device)
    _learn_directions(background, dataset, None, torch.square, runtime)
    return background.requires_grad_(False)


def fit_sky(dataset: PixelDataset, horizon: Horizon, runtime: Runtime) -> Background | None:
    """What most photos show in each direction above the horizon; None where that does not follow from the direction."""
    index = dataset.draw(SKY_PIXELS, runtime)
    index = index[horizon.is_sky(dataset.rays(index).viewdirs)]
    if len(index) < FEWEST_SKY_PIXELS:
        return None
    sky = Background().to(runtime.device)
    # absolute differences: things before the sky are strays
    gaps = _learn_directions(sky, dataset, index, torch.abs, runtime)
    return sky if float(gaps.quantile(AGREEING)) < SKY_LIKENESS else None


def _learn_directions(
    background: Background,
    dataset: PixelDataset,
    index: Tensor | None,
    penalty: Callable[[Tensor], Tensor],
    runtime: Runtime,
) -> Tensor:
    """Learn the colors of random pixels, or of those in `index`; differences of the last ones, [n] in a channel."""
    optimizer = Adam(background.parameters(), lr=1e-2)
    for _ in range(200):
        some = dataset.draw(2048, runtime) if index is None else index[runtime.randint(len(index), 2048)]
        gaps = background(dataset.rays(some).viewdirs) - dataset.color[some].float() / 255
        loss = penalty(gaps).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return gaps.detach().square().mean(1).sqrt()
