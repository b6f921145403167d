"""Rendering: masks, pictures, recolored frames and edit planes of captured views or of any cameras.

Options: views (train | test | val | all | name,name | CAMERAS.json), edit (EDIT.json, or a list with one for each view,
in their order, or a folder with <view>.json for each), first, last, count (which part of the views, counted from 1;
count: at most so many), out (folder), base (photo | render, for captured views; by default the photo, with the paper's
compositing the render, as there), size (photo | learned | pixels of the long side, for captured views with the photo as
base), format (png8 | png16 | exr16 | exr32, of recolored pictures that are none of a photo's size), planes, layers,
depth, unsure, alpha, jpeg (bools), overrides (texts render.field=value), skip_existing (bool: keep frames that are there
already, made from the same). Writes

    OUT/render/<view>.png            the scene as learned; with alpha without what is behind it
    OUT/masks/<object>/<view>.png    0 or 255
    OUT/recolor/<view>.png           the edited base picture; of a photo .png, .tif or .exr (with jpeg .jpg) as it came
    OUT/depth/<view>.npy             float32 along the optical axis, world units, 0 where empty
    OUT/unsure/<object>/<view>.png   8 bits, 255 where nothing is sure that is said of the object
    OUT/layers/<view>.exr            base, coverage, weights, depth and mattes for compositors (export.layers)
    OUT/planes/<view>.npz            edit planes; of captured views also in the project, where Blender finds them
    OUT/finished.jsonl               what each frame was made from

Of a photo, masks and recolored picture are in the grid of the photo as stored, at the size that was asked for; at the
size `learned`, as its pinhole shows it. Layers are as its camera is turned. All else of captured views is as learned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from ..capture.capture import View
from ..capture.chosen_views import choose_views, part_of
from ..compute.progress import Emit
from ..errors import BadRequest
from ..export.finished_frames import ModelMark, model_mark, pending_frames
from ..export.frame_files import write_view
from ..export.frame_options import RenderOptions
from ..io.color_spaces import color_space
from ..palettes.palette import Edit, Palette
from ..palettes.palette_files import read_edit_file
from ..project.locking import consistent, opened, writing
from ..project.settings import with_overrides
from ..recolor.model import Model
from .disputes import Disputes
from .job import Job, open_job


def run(options: RenderOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. With planes, which belong to the project, it is held for writing."""
    if options.out is None and not options.planes:
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    if options.layer_space is not None:
        color_space(options.layer_space, options.ocio)  # an unknown one is told before anything is rendered
    project = opened(options.project)
    project.require("geometry")
    with writing(project) if options.planes else nullcontext():
        with consistent(project):
            job = _with_overrides(open_job(options, emit, should_stop), options.overrides)
            model, learned = Model(project, job.runtime.device, job.settings), model_mark(project, job.settings)
        _render(job, model, learned, options)


def _render(job: Job, model: Model, learned: ModelMark, options: RenderOptions) -> None:
    """Render what is not finished. learned: `model_mark` of the model."""
    if options.unsure:
        job.project.require("segmentation")
    if options.edit or options.planes or options.layers:
        job.project.require("recoloring")
    views, captured = choose_views(job.capture(), options.views)
    part = part_of(views, options.first, options.last, options.count)
    edits = read_edits(options.edit, views, model.palettes, job.settings.compositing)[part]
    frames = pending_frames(options, learned, views[part], edits)
    job.emit("stage", name="render", text=f"{len(edits)} views")
    progress = job.progress("render", len(edits))
    progress.resume_at(len(edits) - len(frames.todo))
    disputes = Disputes()
    for view, edit, mark in frames.todo:
        files, disputed = write_view(model, view, edit, captured, options, job.artifact)
        disputes.add(view.name, disputed)
        frames.note(view.name, mark, files)
        progress.step()
    disputes.tell(job.emit)
    if options.out is not None:
        job.artifact("frames", options.out)


def _with_overrides(job: Job, overrides: Sequence[str]) -> Job:
    """The job with other settings of how it renders. Raises BadRequest where others are asked for."""
    settings = with_overrides(job.settings, list(overrides))
    if replace(settings, render=job.settings.render) != job.settings:
        raise BadRequest("Only settings of render can change now.", "Learn again with the others.")
    return replace(job, settings=settings)


def read_edits(
    wanted: Path | Sequence[Path] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """The edit of each view. compositing: see `read_edit_file`.

    wanted: one file for all, one for each, a folder with `<view>.json` for each, or None.

    Raises BadRequest where their number is not that of the views, DataError where one is not an edit of these palettes.
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
    return [known.get(path) for path in paths]
