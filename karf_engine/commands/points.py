"""Sample the scene's surface as points, for viewers."""

from __future__ import annotations

from collections.abc import Callable

from ..compute.progress import Emit
from ..errors import BadRequest
from ..export.point_sampling import chosen_views, scene_points
from ..export.scene_points import write_ply, write_points
from ..palettes.compositing import stack_palettes
from ..palettes.palette_files import read_edit_file
from ..project import Project
from ..recolor.model import Model
from .job import open_job
from .options import PointsOptions

KINDS = (".npz", ".ply")


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
    views = job.capture().split("train") or job.capture().views
    emit("stage", name="points", text=f"{len(chosen_views(views))} views")
    points = scene_points(model, views, options.count, job.progress("points", len(chosen_views(views))))
    if is_ply:
        palettes = model.learned_colors
        if edit is not None:
            points = points.with_edges(model.palettes, edit.edges).with_added(model.palettes, edit.added)
            palettes = stack_palettes(model.objects, edit.colors)
        write_ply(out, points.positions, points.normals, points.recolored(palettes))
    else:
        write_points(out, points)
    job.artifact("points", out)
