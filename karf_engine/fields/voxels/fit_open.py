"""Training in open space: scenes that extend behind the object and the cameras, without a separate background.

The grid is in a contraction or a frustum (see rendering/space.py), and every ray must end on something. Photos alone
do not determine where: fog in front of the cameras explains them too, but fails from new views. Sparse points do: a ray
to a point is free before it and ends there (DS-NeRF, Deng et al. 2022; Urban Radiance Fields, Rematas et al. 2022).
Above the horizon there may be a sky, a function of direction; opacity in front of it is penalized.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor, nn

from ...compute.runtime import Runtime
from ...project.settings import Level, OpenSettings
from ..priors import FreeSpace, Horizon
from ..rendering.rays import PixelDataset
from ..rendering.space import OpenSpace
from ..scene import Background
from ..training import Adam, TrainingState
from .field import VoxelField
from .fit import Batch, VoxelFit
from .observations import Observations
from .renderer import RayBatch, Renderer
from .vertices import BITS

DENSITY_BIAS = -4.5  # visible fog from the start, since every ray must end on something
LATE_POINTS = 0.25  # factor of the points' weight in the last level, where photos locate surfaces better than points
TV_VERTICES = 30_000
CARVED = 256  # cells along the longest side; from finer levels free space is not carved again
SKY_PIXELS, FEWEST_SKY_PIXELS = 200_000, 200  # pixels drawn from all photos; required above the horizon
SKY_FRACTION, SKY_ERROR = 0.8, 0.11  # of pixels above the horizon that a sky must explain; color error of each
FOG_PENALTY = 5e-2  # weight of opacity where the sky alone explains the photo
COLOR_DEVIATION = 0.2  # standard deviation between photo and sky that count as equal: clouds move


class OpenFit(VoxelFit[OpenSettings]):
    """Fit of a field in open space. horizon: there may be a sky above it; None for no sky."""

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
        return field.refined(level.voxels, lambda cells: ~self._free.contains(field.space.to_world(cells)))

    def _set_field(self, field: VoxelField, renderer: Renderer, training_state: TrainingState) -> None:
        super()._set_field(field, renderer, training_state)
        self._vertices = field.numbers()

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        settings, runtime, dataset = self.recipe, self.runtime, self.dataset
        n_observed = int(n_rays * settings.point_share) if len(self._observations) else 0
        index = dataset.draw(n_rays, runtime)
        chosen = runtime.randint(max(1, len(self._observations)), n_observed)
        index[n_rays - n_observed :] = self._observations.index[chosen]
        jitter, observed = runtime.rand(n_rays), self._observations.positions[chosen]
        rays, target = dataset.rays(index), dataset.normalized_colors(index)
        sums = self.renderer.render(RayBatch(rays, level.step, jitter, number == 0, observed))
        # random colors behind everything but the sky, so that rays must end on something
        behind, passing = runtime.rand(n_rays, 3), settings.transparency * sums.final_transmittance
        if self._horizon is not None:
            assert self.background is not None
            is_sky, sky = self._horizon.is_sky(rays.viewdirs), self.background(rays.viewdirs)
            explained = torch.exp(-((sky.detach() - target) ** 2).sum(1) / (2 * COLOR_DEVIATION**2))
            behind = torch.where(is_sky[:, None], sky, behind)
            passing = torch.where(is_sky, FOG_PENALTY * explained * (1 - sums.final_transmittance), passing)
        error = ((sums.color + sums.final_transmittance[:, None] * behind - target) ** 2).mean()
        loss = error + settings.distortion * sums.distortion.mean() + passing.mean()
        loss = loss + settings.total_variation * self._total_variation()
        if n_observed:
            strength = settings.point_depth * (LATE_POINTS if level is settings.levels[-1] else 1.0)
            # weight in front of an observed point, and weight missing up to it
            missed = (sums.before + 1 - sums.up_to) * sums.observes
            loss = loss + strength * missed.sum() / n_observed
        return Batch(loss, error, sums.n_samples)

    def _trained_networks(self, field: VoxelField) -> list[nn.Parameter]:
        sky = [] if self._horizon is None or self.background is None else list(self.background.parameters())
        return super()._trained_networks(field) + sky

    def _total_variation(self) -> Tensor:
        """Return the mean squared difference to the next vertex along each axis, over random vertices."""
        field = self.field
        # sorted, since memory latency dominates
        rows = self.runtime.randint(len(self._vertices), TV_VERTICES).sort().values
        steps = field.vertex_numbers(torch.eye(3, dtype=torch.long, device=rows.device))
        last = field.index.numel() * BITS - 1
        neighbors = field.rows_of((self._vertices[rows, None] + steps).clamp_max(last))
        density, features = self.renderer.differences(rows.repeat_interleave(3), neighbors.view(-1))
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
    """Create the fit of a new field in the part of a space that cameras see and that is not known to be free."""
    low, high = space.grid_bounds(dataset.cameras)
    voxel = float((high - low).max()) / settings.levels[0].voxels
    shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
    occupied = torch.ones(shape, dtype=torch.bool, device=runtime.device)
    cells = low + (torch.nonzero(occupied) + 0.5) * voxel
    occupied = (space.is_seen(cells, dataset.cameras) & ~free.contains(space.to_world(cells))).view(shape)
    field = VoxelField(low, voxel, occupied, n_features, 64, DENSITY_BIAS, space)
    return OpenFit(dataset, settings, runtime, field, observations, free, horizon)


def fit_background(dataset: PixelDataset, runtime: Runtime) -> Background:
    """Fit the photos' mean color in each direction, which fills gaps that no photo sees."""
    background = Background().to(runtime.device)
    _fit_directions(background, dataset, None, torch.square, runtime)
    return background.requires_grad_(False)


def fit_sky(dataset: PixelDataset, horizon: Horizon, runtime: Runtime) -> Background | None:
    """Fit the color of each direction above the horizon; None if the photos disagree there."""
    index = dataset.draw(SKY_PIXELS, runtime)
    index = index[horizon.is_sky(dataset.rays(index).viewdirs)]
    if len(index) < FEWEST_SKY_PIXELS:
        return None
    sky = Background().to(runtime.device)
    # absolute differences: objects in front of the sky are outliers
    errors = _fit_directions(sky, dataset, index, torch.abs, runtime)
    return sky if float(errors.quantile(SKY_FRACTION)) < SKY_ERROR else None


def _fit_directions(
    background: Background,
    dataset: PixelDataset,
    index: Tensor | None,
    penalty: Callable[[Tensor], Tensor],
    runtime: Runtime,
) -> Tensor:
    """Fit a background to the pixels in `index`, or to all; return the RMS errors of the last batch, [n]."""
    optimizer, gaps = Adam(background.parameters(), lr=1e-2), torch.zeros(0, 3)
    for _ in range(200):
        batch = dataset.draw(2048, runtime) if index is None else index[runtime.randint(len(index), 2048)]
        gaps = background(dataset.rays(batch).viewdirs) - dataset.color[batch].float() / 255
        loss = penalty(gaps).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return gaps.detach().square().mean(1).sqrt()
