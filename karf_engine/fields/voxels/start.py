"""Creation of a voxel fit for the space of a capture."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from ...project.settings import Level
from ..fit import FitInputs
from ..free_space import FreeSpace
from ..horizon import horizon_of
from ..rendering.space import OpenSpace
from ..rendering.space_values import space_on
from ..spaces import contraction_round_focus, middle_frustum
from .fit import VoxelFit
from .fit_box import start_box_fit
from .fit_open import start_open_fit
from .observations import observations_of


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
        space = middle_frustum(inputs.views, inputs.points)
        levels = tuple(_finer(level, recipe.frustum_detail) for level in recipe.levels)
        smoothness = recipe.frustum_smoothness * recipe.total_variation
        recipe = replace(recipe, levels=levels, total_variation=smoothness)
    else:
        space = contraction_round_focus(dataset.cameras, recipe)
        horizon = horizon_of(dataset.cameras, inputs.points, space.center, space.radius).to(runtime.device)
    space = cast(OpenSpace, space_on(space, runtime.device))
    observations = observations_of(dataset, space, inputs.points)
    free = FreeSpace.of(inputs.views, inputs.points, runtime.device)
    return start_open_fit(dataset, space, recipe, settings.features, observations, free, horizon, runtime)


def _finer(level: Level, factor: float) -> Level:
    return replace(level, voxels=round(factor * level.voxels))
