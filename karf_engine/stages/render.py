"""Rendering: masks, pictures, recolored frames and edit planes of captured views or of any cameras.

Options: views (train | test | val | all | name,name | CAMERAS.json), edit (EDIT.json, or a list with one for each view,
in their order), out (folder), base (photo | render, for captured views; by default the photo, with the paper's
compositing the render, as there), size (photo | learned | pixels of the long side, for captured views with the photo as
base), planes, depth, alpha, jpeg (bools), overrides (texts render.field=value). Writes

    OUT/render/<view>.png            the scene as learned; with alpha without what is behind it
    OUT/masks/<object>/<view>.png    0 or 255
    OUT/recolor/<view>.png           the edited base picture; of a photo .png, .tif or .exr (with jpeg .jpg) as it came
    OUT/depth/<view>.npy             float32 along the optical axis, world units, 0 where empty
    OUT/planes/<view>.npz            edit planes; of captured views also in the project, where Blender finds them

A photo's masks and recolored pictures are of the size that was asked for, in the grid of the photo as stored, but with
`learned` as its pinhole shows it. All else of captured views is as learned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..capture import open_capture
from ..capture.capture import View
from ..color import to_bytes
from ..edit.compositing import Planes, write_planes
from ..edit.palette import Edit, Palette, read_edit
from ..errors import BadRequest, DataError
from ..files import atomic_write
from ..frames import Frame, with_alpha
from ..images import write_png
from ..locking import consistent, opened, writing
from ..model import Model
from ..photos import suffix_for, write_mask, write_photo
from ..progress import Emit
from ..settings import with_overrides
from ..wire import Request
from .job import Job, open_job


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. With planes, which belong to the project, it is held for writing."""
    project = opened(request.project)
    project.require("geometry")
    with writing(project) if request.options.get("planes") else nullcontext():
        with consistent(project):
            job = _with_overrides(open_job(request, emit, should_stop))
            model = Model(project, job.runtime.device, job.settings)
        _render(job, model)


def _render(job: Job, model: Model) -> None:
    options = job.options
    if options.get("edit") or options.get("planes"):
        job.project.require("recoloring")
    if not options.get("out") and not options.get("planes"):
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    size_of(options.get("size"))
    views, captured = select_views(job, options.get("views", "test"))
    edits = read_edits(options.get("edit"), views, model.palettes, job.settings.compositing)
    progress = job.progress("render", len(views))
    job.emit("stage", name="render", text=f"{len(views)} views")
    from_photos = captured and model.base_of(options.get("base")) == "photo"
    write = _write_photo_view if from_photos else _write_rendered_view
    for view, edit in zip(views, edits, strict=True):
        write(job, model, view, edit, captured)
        progress.step()
    if options.get("out"):
        job.artifact("frames", Path(options["out"]))


def _with_overrides(job: Job) -> Job:
    """The job with other settings of how it renders. Raises BadRequest where others are asked for."""
    settings = with_overrides(job.settings, job.options.get("overrides") or [])
    if replace(settings, render=job.settings.render) != job.settings:
        raise BadRequest("Only settings of render can change now.", "Learn again with the others.")
    return replace(job, settings=settings)


def size_of(wanted: str | int | None) -> str | int:
    """The size of recolored photos that was asked for: `photo`, `learned`, or pixels. Raises BadRequest for others."""
    if wanted in (None, "photo", "learned"):
        return wanted or "photo"
    if not str(wanted).isascii() or not str(wanted).isdigit() or int(wanted) < 1:
        raise BadRequest(f"{wanted!r:.200} is no size.", "Use photo, learned, or the long side in pixels.")
    return int(wanted)


def select_views(job: Job, wanted: str) -> tuple[list[View], bool]:
    """The views that `views` names, and whether they are captured ones.

    Raises DataError where a name is unknown or a split is empty.
    """
    capture = job.capture()
    if wanted in ("train", "test", "val", "all"):
        views = list(capture.split(wanted))
        if not views:
            raise DataError(f"{capture.source} has no {wanted} views.", "Use another split, or all.")
        return views, True
    if wanted.endswith(".json"):
        return list(open_capture(Path(wanted), photos=False).views), False
    return [capture.view(name.strip()) for name in wanted.split(",")], True


def read_edits(
    wanted: str | list[str] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """The edit of each view: wanted is one file for all, one for each, or None. compositing: see `read_edit`.

    Raises BadRequest where there are as many files as views in no way, DataError where one is no edit of these palettes.
    """
    paths = wanted if isinstance(wanted, list) else [wanted] * len(views)
    if len(paths) != len(views) or not all(path is None or isinstance(path, str) for path in paths):
        raise BadRequest(
            f"The render stage was given {len(paths)} edits for {len(views)} views.",
            "Give one edit file for all, or a list with one for each view.",
        )
    known = {path: read_edit(Path(path), palettes, compositing) for path in set(paths) if path}
    return [known.get(path) for path in paths]


def _write_rendered_view(job: Job, model: Model, view: View, edit: Edit | None, captured: bool) -> None:
    camera = model.working_camera(view) if captured else view.camera
    frame = model.render(camera, job.settings.render.supersampling)
    if out := job.options.get("out"):
        behind = model.behind(camera) if job.options.get("alpha") else None
        _write_look(job, Path(out), view.name, frame, behind)
        _write_masks(Path(out), view.name, model.objects, frame.masks)
        if edit is not None:
            write_png(Path(out) / "recolor" / f"{view.name}.png", _cut_out(model.composite(frame, edit), frame, behind))
    if job.options.get("planes"):
        _write_planes(job, view, frame, model, captured)


def _write_photo_view(job: Job, model: Model, view: View, edit: Edit | None, captured: bool) -> None:
    if out := job.options.get("out"):
        pinhole = model.working_camera(view).without_distortion()
        behind = model.behind(pinhole) if job.options.get("alpha") else None
        _write_look(job, Path(out), view.name, model.look(pinhole), behind)
        if size_of(job.options.get("size")) == "learned":
            _write_learned_size(job, Path(out), view, model, edit)
        else:
            _write_finished(job, Path(out), view, model, edit)
    if job.options.get("planes"):
        _write_planes(job, view, model.preview(view), model, captured)


def _write_learned_size(job: Job, out: Path, view: View, model: Model, edit: Edit | None) -> None:
    frame = model.preview(view, job.settings.geometry.long_side)
    _write_masks(out, view.name, model.objects, frame.masks)
    if edit is not None:
        write_png(out / "recolor" / f"{view.name}.png", model.composite(frame, edit))


def _write_finished(job: Job, out: Path, view: View, model: Model, edit: Edit | None) -> None:
    """Masks and recolored picture in the photo's own pixels."""
    finished = model.photo_view(view, size_of(job.options.get("size")))
    for name, mask in zip(finished.objects, finished.masks(), strict=True):
        write_mask(out / "masks" / name / f"{view.name}.png", mask, finished.photo.header.orientation)
    if edit is not None:
        suffix = suffix_for(finished.photo, bool(job.options.get("jpeg")))
        write_photo(out / "recolor" / f"{view.name}{suffix}", finished.recolored(edit))


def _write_look(job: Job, out: Path, name: str, frame: Frame, behind: np.ndarray | None) -> None:
    write_png(out / "render" / f"{name}.png", _cut_out(frame.color, frame, behind))
    if job.options.get("depth"):
        atomic_write(out / "depth" / f"{name}.npy", lambda temporary: np.save(temporary, frame.depth))


def _cut_out(color: np.ndarray, frame: Frame, behind: np.ndarray | None) -> np.ndarray:
    return color if behind is None else with_alpha(color, frame.opacity, behind)


def _write_masks(out: Path, view: str, objects: Sequence[str], masks: np.ndarray) -> None:
    for name, mask in zip(objects, masks, strict=True):
        write_png(out / "masks" / name / f"{view}.png", mask)


def _write_planes(job: Job, view: View, frame: Frame, model: Model, captured: bool) -> None:
    planes = Planes(
        tuple(model.objects),
        frame.palette_weights.astype(np.float16),
        frame.probabilities.astype(np.float16),
        to_bytes(frame.base),
    )
    if job.options.get("out"):
        write_planes(Path(job.options["out"]) / "planes" / f"{view.name}.npz", planes)
    if captured:
        write_planes(job.project.planes_file(view.name), planes)
        job.artifact("planes", job.project.planes_file(view.name))
