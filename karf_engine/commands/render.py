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
    OUT/layers/<view>.exr            base, coverage, weights, depth and mattes for compositors (handover.layers)
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
from ..export.finished_frames import model_mark, pending_frames
from ..export.frame_files import check_format, size_of, write_view
from ..palettes.palette import Edit, Palette
from ..palettes.palette_files import read_edit_file
from ..project.locking import consistent, opened, writing
from ..project.settings import with_overrides
from ..recolor.model import Model
from ..wire import Request
from .disputes import Disputes
from .job import Job, open_job


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. With planes, which belong to the project, it is held for writing."""
    project = opened(request.project)
    project.require("geometry")
    with writing(project) if request.options.get("planes") else nullcontext():
        with consistent(project):
            job = _with_overrides(open_job(request, emit, should_stop))
            model, learned = Model(project, job.runtime.device, job.settings), model_mark(job)
        _render(job, model, learned)


def _render(job: Job, model: Model, learned: str) -> None:
    """Render what is not finished. learned: `model_mark` of the model."""
    options = job.options
    if options.get("unsure"):
        job.project.require("segmentation")
    if options.get("edit") or options.get("planes") or options.get("layers"):
        job.project.require("recoloring")
    if not options.get("out") and not options.get("planes"):
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    size_of(options.get("size"))  # before anything is rendered
    check_format(options.get("format"))
    views, captured = choose_views(job.capture(), options.get("views", "all"))
    part = part_of(views, options.get("first"), options.get("last"), options.get("count"))
    edits = read_edits(options.get("edit"), views, model.palettes, job.settings.compositing)[part]
    views = views[part]
    frames = pending_frames(job, learned, views, edits)
    job.emit("stage", name="render", text=f"{len(views)} views")
    progress = job.progress("render", len(views))
    progress.resume_at(len(views) - len(frames.todo))
    disputes = Disputes()
    for view, edit, mark in frames.todo:
        files, disputed = write_view(job, model, view, edit, captured)
        disputes.add(view.name, disputed)
        frames.note(view.name, mark, files)
        progress.step()
    disputes.tell(job.emit)
    if options.get("out"):
        job.artifact("frames", Path(options["out"]))


def _with_overrides(job: Job) -> Job:
    """The job with other settings of how it renders. Raises BadRequest where others are asked for."""
    settings = with_overrides(job.settings, job.options.get("overrides") or [])
    if replace(settings, render=job.settings.render) != job.settings:
        raise BadRequest("Only settings of render can change now.", "Learn again with the others.")
    return replace(job, settings=settings)


def read_edits(
    wanted: str | list[str] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """The edit of each view. compositing: see `read_edit_file`.

    wanted: one file for all, one for each, a folder with `<view>.json` for each, or None.

    Raises BadRequest where their number is not that of the views, DataError where one is no edit of these palettes.
    """
    if isinstance(wanted, str) and Path(wanted).is_dir():
        wanted = [str(Path(wanted, f"{view.name}.json")) for view in views]
    paths = wanted if isinstance(wanted, list) else [wanted] * len(views)
    if len(paths) != len(views) or not all(path is None or isinstance(path, str) for path in paths):
        raise BadRequest(
            f"The render stage was given {len(paths)} edits for {len(views)} views.",
            "Give one edit file for all, or a list with one for each view.",
        )
    known = {path: read_edit_file(Path(path), palettes, compositing) for path in set(paths) if path}
    return [known.get(path) for path in paths]
