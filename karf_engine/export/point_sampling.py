"""Recolorable points on the surface of a learned scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from ..capture.capture import View
from ..compute.progress import Progress
from ..errors import BadRequest
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.scene_surface import SurfacePoints, surface_points
from ..heads.rendering import object_samples, weigh_cache
from ..io.color import to_bytes
from ..recolor.borders import measure_borders
from ..recolor.field_rendering import weights_of_colors
from ..recolor.model import Model
from ..segmentation.views import farthest_point_views
from .scene_points import ScenePoints

COUNT, FEWEST, MOST = 60_000, 1000, 2_000_000  # default, minimum and maximum
MOST_VIEWS = 64


def scene_points(model: Model, views: Sequence[View], count: int, progress: Progress | None = None) -> ScenePoints:
    """Sample about `count` surface points of a learned model with palettes, in `chosen_views`.

    Raises:
        BadRequest: No palettes are learned, or the count is out of range.
        DataError: The scene has no surface.
    """
    model.project.require("recoloring")
    if not FEWEST <= count <= MOST:
        raise BadRequest(f"{count} points cannot be made.", f"Ask for {FEWEST} to {MOST}.")
    step = (lambda: None) if progress is None else progress.step
    return _described(model, surface_points(model.scene, chosen_views(views), count, step))


def chosen_views(views: Sequence[View]) -> list[View]:
    """Choose at most MOST_VIEWS views, spread around the scene, that are rendered for points."""
    return farthest_point_views(views, [], MOST_VIEWS)


@torch.no_grad()
def _described(model: Model, points: SurfacePoints) -> ScenePoints:
    """Evaluate F_s, and F_w where it is trained, at the points, along their mean viewing directions."""
    assert model.segmentation is not None
    n = len(points.positions)
    positions, viewdirs = (torch.from_numpy(each).to(model.device) for each in (points.positions, points.viewdirs))
    cache = SurfaceCache(
        positions[:, None], positions.new_zeros(n, 1), viewdirs, positions.new_ones(n),
        torch.arange(n, device=model.device),
    )  # fmt: skip
    samples = object_samples(model.segmentation, model.scene.field, cache)
    shares = samples.rendered[:, 1:].cpu().numpy()
    if model.recoloring is not None:
        weights = weigh_cache(model.recoloring, samples, cache).half().cpu().numpy()
    else:
        weights = weights_of_colors(model, points.colors[None], shares.T[:, None])[:, :, 0]
        weights = weights.transpose(2, 0, 1).astype(np.float16)
    return ScenePoints(
        tuple(model.objects),
        points.world_positions,
        points.normals,
        points.spacing,
        to_bytes(points.colors),
        shares.astype(np.float16),
        weights,
        model.learned_colors,
        measure_borders(points.world_positions, shares, np.ones(n, bool), model.capture.views),
    )
