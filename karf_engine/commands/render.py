"""Render masks, pictures, recolored frames and edit planes of captured views or of any cameras.

Writes

    OUT/render/<view>.png            the scene as learned; with alpha without the background
    OUT/masks/<object>/<view>.png    0 or 255
    OUT/recolor/<view>.png           the edited base picture; photos keep .png, .tif or .exr (with jpeg .jpg); by `names`
    OUT/depth/<view>.npy             float32 along the optical axis, world units, 0 where empty
    OUT/unsure/<object>/<view>.png   8 bits, 255 where the object's labels are most uncertain
    OUT/recolor/<view>_layered.exr   photo, recolored picture, mask and change of each object (export.layered)
    OUT/layers/<view>.exr            base, coverage, weights, depth and mattes for compositors (export.layers)
    OUT/planes/<view>.npz            edit planes; for captured views also in the project, for Blender
    OUT/finished.jsonl               the inputs of each finished frame

With a photo as base, masks and recolored pictures have the pixel grid of the stored photo at the requested size, or with
the size `learned` that of the undistorted training image. Layers have the orientation of the camera. All other files of
captured views have the training size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

from ..capture import choose_views, slice_of_views
from ..capture.capture import View
from ..compute.progress import Emit
from ..errors import BadRequest
from ..export.finished_frames import ModelFingerprint, frame_key, model_fingerprint, pending_frames
from ..export.frame_files import write_view
from ..io.color_spaces import color_space
from ..palettes.palette import Edit, Palette
from ..palettes.palette_files import read_edit_file
from ..project import Project
from ..project.locking import write_lock
from ..recolor.field_rendering import UNTRAINED
from ..recolor.model import Model
from .job import Job, open_job, warn_of_disputes
from .options import RenderOptions


def run(options: RenderOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. Planes belong to the project and require its lock for writing."""
    if options.out is None and not options.planes:
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    if options.layer_space is not None:
        color_space(options.layer_space, options.ocio)  # refuse an unknown one before rendering
    project = Project(options.project)
    project.require("geometry")
    with write_lock(project) if options.planes else nullcontext():
        job = open_job(options, emit, should_stop, project.snapshot()).with_overrides("render", options.overrides)
        model = Model(job.project, job.runtime.device, job.settings)
        _render(job, model, model_fingerprint(job.project, job.settings), options)


def _render(job: Job, model: Model, learned: ModelFingerprint, options: RenderOptions) -> None:
    if options.unsure:
        job.project.require("segmentation")
    if options.edit or options.planes or options.layers:
        job.project.require("recoloring")
        is_by_field = model.settings.render.source == "field" or model.settings.compositing == "paper"
        if is_by_field and model.splats is None and model.recoloring is None:
            job.emit("warning", code="recoloring", sentence=" ".join(UNTRAINED).format(folder=model.project.folder))
    views, captured = choose_views(job.capture(), options.views)
    part = slice_of_views(views, options.first, options.last, options.count)
    edits = read_edits(options.edit, views, model.palettes, job.settings.compositing)[part]
    if options.layered and any(edit is not None and edit.compositing == "paper" for edit in edits):
        raise BadRequest("A layered picture cannot hold an edit with compositing paper.", "Use delta, or no --layered.")
    todo, finished = pending_frames(options, learned, views[part], edits)
    job.emit("stage", name="render", text=f"{len(edits)} views")
    progress = job.progress("render", len(edits))
    progress.resume_at(len(edits) - len(todo))
    disputed = {}
    for view, edit, mark in todo:
        files, disputed[view.name] = write_view(model, view, edit, captured, options, job.artifact)
        if finished is not None:
            finished.record(frame_key(options, view.name), mark, files, edit)
        progress.step()
    warn_of_disputes(disputed, job.emit)
    if options.out is not None:
        job.artifact("frames", options.out)


def read_edits(
    wanted: Path | Sequence[Path] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """Read the edit of each view, from one file for all, one for each, or a folder with `<view>.json` for each.

    Raises BadRequest if there are not as many edits as views. compositing: see `read_edit_file`.
    """
    if isinstance(wanted, Path) and wanted.is_dir():
        wanted = [wanted / f"{view.name}.json" for view in views]
    paths = [wanted] * len(views) if wanted is None or isinstance(wanted, Path) else wanted
    if len(paths) != len(views):
        raise BadRequest(
            f"The render stage was given {len(paths)} edits for {len(views)} views.",
            "Give one edit file for all, or a list with one for each view.",
        )
    known = {path: read_edit_file(path, palettes, compositing) for path in set(paths) if path}
    return [known[path] if path else None for path in paths]
