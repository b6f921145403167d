"""Creation of a voxel fit for the space of a capture."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from ...project.settings import Level
from ..extent import contraction_around_focus, mean_frustum
from ..fit import FitInputs
from ..priors import FreeSpace, estimate_horizon
from ..rendering.space import OpenSpace, space_to_device
from .fit import VoxelFit
from .fit_box import start_box_fit
from .fit_open import start_open_fit
from .observations import find_observations


def start_voxel_fit(inputs: FitInputs) -> VoxelFit:
    """Create the fit of a new voxel field.

    Raises:
        BadRequest: The space is a frustum and the nearest depth is unknown.
    """
    dataset, settings, runtime = inputs.dataset, inputs.settings, inputs.runtime
    if inputs.space == "box":
        return start_box_fit(dataset, inputs.background_kind, settings, runtime)
    recipe, horizon = settings.open, None
    if inputs.space == "frustum":
        space = mean_frustum(inputs.views, inputs.points)
        levels = tuple(_finer(level, recipe.frustum_detail) for level in recipe.levels)
        smoothness = recipe.frustum_smoothness * recipe.total_variation
        recipe = replace(recipe, levels=levels, total_variation=smoothness)
    else:
        space = contraction_around_focus(dataset.cameras, recipe)
        horizon = estimate_horizon(dataset.cameras, inputs.points, space.center, space.radius).to(runtime.device)
    space = cast(OpenSpace, space_to_device(space, runtime.device))
    observations = find_observations(dataset, space, inputs.points)
    free = FreeSpace.from_views(inputs.views, inputs.points, runtime.device)
    return start_open_fit(dataset, space, recipe, settings.features, observations, free, horizon, runtime)


def _finer(level: Level, factor: float) -> Level:
    return replace(level, voxels=round(factor * level.voxels))
