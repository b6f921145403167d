"""Sample recolorable points on the scene's surface, for viewers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from ..compute.progress import Emit
from ..errors import BadRequest
from ..export.scene_points import ScenePoints, write_ply, write_points
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.scene_surface import SurfacePoints, surface_points
from ..heads.rendering import object_samples, weigh_cache
from ..io.color import to_bytes
from ..palettes.compositing import stack_palettes
from ..palettes.palette_files import read_edit_file
from ..project import Project
from ..recolor.borders import measure_borders
from ..recolor.field_rendering import weights_of_colors
from ..recolor.model import Model
from ..segmentation.views import farthest_point_views
from .job import open_job
from .options import PointsOptions

KINDS = (".npz", ".ply")
FEWEST, MOST = 1000, 2_000_000
MOST_VIEWS = 64


def run(options: PointsOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the points. Raises BadRequest for other suffixes than .npz and .ply, or an edit with .npz."""
    project = Project(options.project).snapshot()
    out, is_ply = options.out, options.out.suffix.lower() == ".ply"
    if out.suffix.lower() not in KINDS:
        raise BadRequest(
            f"The points were given no file to write: {out}.", f"Name one that ends with {' or '.join(KINDS)}."
        )
    if options.edit and not is_ply:
        raise BadRequest(f"{out} cannot be written with the edit {options.edit}.", "Give a .ply to write.")
    project.require("recoloring")
    job = open_job(options, emit, should_stop, project)
    model = Model(project, job.runtime.device)
    edit = read_edit_file(options.edit, model.palettes, job.settings.compositing) if options.edit else None
    views = farthest_point_views(job.capture().split("train") or job.capture().views, [], MOST_VIEWS)
    emit("stage", name="points", text=f"{len(views)} views")
    if not FEWEST <= options.count <= MOST:
        raise BadRequest(f"{options.count} points cannot be made.", f"Ask for {FEWEST} to {MOST}.")
    progress = job.progress("points", len(views))
    points = _scene_points(model, surface_points(model.scene, views, options.count, progress.step))
    if is_ply:
        palettes = model.learned_colors
        if edit is not None:
            points = points.with_edges(model.palettes, edit.edges).with_added(model.palettes, edit.added)
            palettes = stack_palettes(model.objects, edit.colors)
        write_ply(out, points.positions, points.normals, points.recolored(palettes))
    else:
        write_points(out, points)
    job.artifact("points", out)


@torch.no_grad()
def _scene_points(model: Model, points: SurfacePoints) -> ScenePoints:
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
