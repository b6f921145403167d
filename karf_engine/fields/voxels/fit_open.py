"""Training in open space: scenes that extend behind the object and the cameras, without a separate background.

The grid is in a contraction or a frustum (see rendering/space.py), and every ray must end on something. Photos alone
do not determine where: fog in front of the cameras explains them too, but fails from new views. Sparse points do: a ray
to a point is free before it and ends there (DS-NeRF, Deng et al. 2022; Urban Radiance Fields, Rematas et al. 2022).
Above the horizon there may be a sky, a function of direction; opacity in front of it is penalized.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import torch
from torch import Tensor

from ...capture.capture import SparsePoints
from ...compute.runtime import Runtime
from ...project.settings import Level, OpenSettings
from ..extent import contraction_around_focus, is_reliable, mean_frustum
from ..fit import FitInputs
from ..priors import FreeSpace, Horizon, estimate_horizon
from ..rendering.rays import PixelDataset
from ..rendering.space import OpenSpace, Space, space_to_device
from ..scene import Background
from ..training import Adam, TrainingState
from .field import VoxelField
from .fit import VoxelFit
from .fit_box import start_box_fit
from .grid import BITS
from .renderer import RayBatch, Renderer

DENSITY_BIAS = -4.5  # visible fog from the start, since every ray must end on something
LATE_POINTS = 0.25  # factor of the points' weight in the last level, where photos locate surfaces better than points
TV_VERTICES = 30_000
CARVED = 256  # cells along the longest side; from finer levels free space is not carved again
SKY_PIXELS, FEWEST_SKY_PIXELS = 200_000, 200  # pixels drawn from all photos; required above the horizon
SKY_FRACTION, SKY_ERROR = 0.8, 0.11  # of pixels above the horizon that a sky must explain; color error of each
FOG_PENALTY = 5e-2  # weight of opacity where the sky alone explains the photo
COLOR_DEVIATION = 0.2  # standard deviation between photo and sky that count as equal: clouds move


class OpenFit(VoxelFit[OpenSettings]):
    """Fit of a field in open space."""

    cuts = (1 / 4, 1 / 2)
    russian_roulette = 0.02
    background_kind = "opaque"

    def __init__(
        self,
        dataset: PixelDataset,
        settings: OpenSettings,
        runtime: Runtime,
        field: VoxelField,
        observations: tuple[Tensor, Tensor],
        free: FreeSpace,
        horizon: Horizon | None,
    ) -> None:
        """Create a new fit. observations: see `find_observations`. horizon: where a sky may begin; None for no sky."""
        background = fit_background(dataset, runtime)
        sky = None if horizon is None else fit_sky(dataset, horizon, runtime)
        super().__init__(dataset, settings, runtime, field, sky or background)
        self._observing_pixels, self._observed_points = observations
        self._free = free
        self._horizon = None if sky is None else horizon

    def _refined(self, level: Level) -> VoxelField:
        field = self.field
        if level.voxels > CARVED:
            return super()._refined(level)
        return field.refined(level.voxels, lambda cells: ~self._free.contains(field.space.to_world(cells)))

    def _set_field(self, field: VoxelField, renderer: Renderer, training_state: TrainingState) -> None:
        super()._set_field(field, renderer, training_state)
        self._vertices = field.numbers()

    def _losses(self, number: int, level: Level, n_rays: int) -> tuple[Tensor, Tensor, int]:
        settings, runtime, dataset = self.recipe, self.runtime, self.dataset
        n_observations = len(self._observing_pixels)
        n_observed = int(n_rays * settings.point_share) if n_observations else 0
        index = dataset.draw(n_rays, runtime)
        chosen = runtime.randint(max(1, n_observations), n_observed)
        index[n_rays - n_observed :] = self._observing_pixels[chosen]
        jitter, observed = runtime.rand(n_rays), self._observed_points[chosen]
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
        return loss, error, sums.n_samples

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


def start_voxel_fit(inputs: FitInputs) -> VoxelFit:
    """Create the fit of a new field; in open space it fills the part that cameras see and that is not known to be free.

    Raises BadRequest if the space is a frustum and the nearest depth is unknown.
    """
    if inputs.space == "box":
        return start_box_fit(inputs.dataset, inputs.background_kind, inputs.settings, inputs.runtime)
    dataset, cameras, runtime = inputs.dataset, inputs.dataset.cameras, inputs.runtime
    recipe, horizon = inputs.settings.open, None
    if inputs.space == "frustum":
        space = mean_frustum(inputs.views, inputs.points)
        levels = tuple(replace(each, voxels=round(recipe.frustum_detail * each.voxels)) for each in recipe.levels)
        smoothness = recipe.frustum_smoothness * recipe.total_variation
        recipe = replace(recipe, levels=levels, total_variation=smoothness)
    else:
        space = contraction_around_focus(cameras, recipe)
        horizon = estimate_horizon(cameras, inputs.points, space.center, space.radius).to(runtime.device)
    space = cast(OpenSpace, space_to_device(space, runtime.device))
    observations = find_observations(dataset, space, inputs.points)
    free = FreeSpace.from_views(inputs.views, inputs.points, runtime.device)
    low, high = space.grid_bounds(cameras)
    voxel = float((high - low).max()) / recipe.levels[0].voxels
    shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
    occupied = torch.ones(shape, dtype=torch.bool, device=runtime.device)
    cells = low + (torch.nonzero(occupied) + 0.5) * voxel
    occupied = (space.is_seen(cells, cameras) & ~free.contains(space.to_world(cells))).view(shape)
    field = VoxelField(low, voxel, occupied, inputs.settings.features, 64, DENSITY_BIAS, space)
    return OpenFit(dataset, recipe, runtime, field, observations, free, horizon)


def find_observations(dataset: PixelDataset, space: Space, points: SparsePoints | None) -> tuple[Tensor, Tensor]:
    """Return the pixels that observe a reliable sparse point, [m], and the observed points, [m, 3], grid coordinates."""
    index, positions = [torch.zeros(0, dtype=torch.long)], [torch.zeros(0, 3)]
    if points is not None and len(points):
        reliable = is_reliable(points)
        for number, camera in enumerate(dataset.cameras):
            seen = points.point[points.view == number]
            world = points.positions[seen[reliable[seen]]]
            pixels, depth = camera.project(world)
            cells = np.floor(pixels).astype(int)
            inside = (depth > 0) & ((cells >= 0) & (cells < (camera.width, camera.height))).all(1)
            index.append(int(dataset.offsets[number]) + torch.from_numpy(cells[inside] @ (1, camera.width)))
            positions.append(torch.from_numpy(world[inside]).float())
    device = dataset.color.device
    return torch.cat(index).to(device), space.to_grid(torch.cat(positions).to(device))


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
