"""Rendering: masks, pictures, recolored frames and edit planes of captured views or of any cameras.

Options: views (train | test | val | all | name,name | CAMERAS.json), edit (EDIT.json, or a list with one for each view,
in their order), out (folder), base (photo | render, for captured views; by default the photo, with the paper's
compositing the render, as there), planes, layers, depth, skip_existing (bools; the last keeps frames that are there
already, made from the same). Writes

    OUT/render/<view>.png            the scene as learned
    OUT/masks/<object>/<view>.png    0 or 255
    OUT/recolor/<view>.png           the edited base picture
    OUT/depth/<view>.npy             float32 along the optical axis, world units, 0 where empty
    OUT/layers/<view>.exr            base, coverage, weights, depth and mattes for compositors (handover.layers)
    OUT/planes/<view>.npz            edit planes; of captured views also in the project, where Blender finds them
    OUT/finished.jsonl               what each frame was made from
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from ..capture.capture import View
from ..color import to_bytes
from ..edit.compositing import Planes, write_planes
from ..edit.palette import Edit, Palette
from ..edit.palette_files import read_edit_file
from ..errors import BadRequest
from ..files import atomic_write
from ..handover.layers import Layers, write_layers
from ..images import write_png
from ..locking import consistent, opened, writing
from ..model import Frame, Model
from ..progress import Emit
from ..wire import Request
from .chosen_views import select_views
from .finished_frames import unfinished_frames
from .job import Job, open_job


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Render the requested views. With planes, which belong to the project, it is held for writing."""
    project = opened(request.project)
    project.require("geometry")
    with writing(project) if request.options.get("planes") else nullcontext():
        with consistent(project):
            job = open_job(request, emit, should_stop)
            model = Model(project, job.runtime.device)
        _render(job, model)


def _render(job: Job, model: Model) -> None:
    options = job.options
    if options.get("edit") or options.get("planes") or options.get("layers"):
        job.project.require("recoloring")
    if not options.get("out") and not options.get("planes"):
        raise BadRequest("The render stage was given nowhere to write.", "Name a folder with --out.")
    views, captured = select_views(job, options.get("views", "test"))
    edits = read_edits(options.get("edit"), views, model.palettes, job.settings.compositing)
    frames = unfinished_frames(job, views, edits)
    job.emit("stage", name="render", text=f"{len(views)} views")
    progress = job.progress("render", len(views))
    progress.resume_at(len(views) - len(frames.todo))
    for view, edit, mark in frames.todo:
        frame = model.render_view(view, options.get("base")) if captured else model.render(view.camera)
        files = _write_frame(job, Path(options["out"]), view.name, frame, model, edit) if options.get("out") else []
        if options.get("planes"):
            files += _write_planes(job, view, frame, model, captured)
        frames.note(view.name, mark, files)
        progress.step()
    if options.get("out"):
        job.artifact("frames", Path(options["out"]))


def read_edits(
    wanted: str | list[str] | None, views: Sequence[View], palettes: Sequence[Palette], compositing: str
) -> list[Edit | None]:
    """The edit of each view: wanted is one file for all, one for each, or None. compositing: see `read_edit_file`.

    Raises BadRequest where there are as many files as views in no way, DataError where one is no edit of these palettes.
    """
    paths = wanted if isinstance(wanted, list) else [wanted] * len(views)
    if len(paths) != len(views) or not all(path is None or isinstance(path, str) for path in paths):
        raise BadRequest(
            f"The render stage was given {len(paths)} edits for {len(views)} views.",
            "Give one edit file for all, or a list with one for each view.",
        )
    known = {path: read_edit_file(Path(path), palettes, compositing) for path in set(paths) if path}
    return [known.get(path) for path in paths]


def _write_frame(job: Job, out: Path, name: str, frame: Frame, model: Model, edit: Edit | None) -> list[Path]:
    """Write what is asked for of a frame; returns its files."""
    files = [_png(out / "render" / f"{name}.png", frame.color)]
    files += [_png(out / "masks" / k / f"{name}.png", mask) for k, mask in zip(model.objects, frame.masks, strict=True)]
    if edit is not None:
        files.append(_png(out / "recolor" / f"{name}.png", model.composite(frame, edit)))
    if job.options.get("depth"):
        files.append(out / "depth" / f"{name}.npy")
        atomic_write(files[-1], lambda temporary: np.save(temporary, frame.depth))
    if job.options.get("layers"):
        layers = Layers(model.palettes, frame.base, frame.probabilities, frame.palette_weights, frame.depth)
        files.append(out / "layers" / f"{name}.exr")
        write_layers(files[-1], layers)
    return files


def _png(path: Path, picture: np.ndarray) -> Path:
    write_png(path, picture)
    return path


def _write_planes(job: Job, view: View, frame: Frame, model: Model, captured: bool) -> list[Path]:
    """Write a frame's planes; returns those in the output folder."""
    planes = Planes(
        tuple(model.objects),
        frame.palette_weights.astype(np.float16),
        frame.probabilities.astype(np.float16),
        to_bytes(frame.base),
    )
    if captured:
        write_planes(job.project.planes_file(view.name), planes)
        job.artifact("planes", job.project.planes_file(view.name))
    if not job.options.get("out"):
        return []
    path = Path(job.options["out"]) / "planes" / f"{view.name}.npz"
    write_planes(path, planes)
    return [path]
