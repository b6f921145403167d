"""Stage 0: photos -> radiance field (geometry.safetensors).

Options: capture (path), preset, overrides (list of `stage.field=value`), threads, device.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .. import settings as settings_module
from ..capture import open_capture
from ..capture.capture import Capture, capture_to_json
from ..errors import BadRequest, DataError
from ..field.fit import Fit, start_fit
from ..field.scene import Scene
from ..images import Plate, background_kind, solid_pixels, write_png
from ..progress import Emit
from ..project import Project, read_json, write_json
from ..rendering.rays import PixelBank
from ..settings import Settings
from ..wire import Request
from .job import Job, make_job, run_stage, stage_fingerprint


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Learn the scene of `options["capture"]` into the project; a finished one of the same inputs is kept."""
    options = request.options
    if "capture" not in options:
        raise BadRequest("The geometry stage was given no capture.", "Name a folder or file with photos and poses.")
    settings = settings_module.with_overrides(
        settings_module.preset(options.get("preset", "demo")), options.get("overrides", [])
    )
    capture = open_capture(Path(options["capture"]))
    for remark in capture.remarks:
        emit("warning", code="capture", sentence=remark)
    project = _open_project(request.project, options["capture"], capture, settings)
    job = make_job(project, options, settings, emit, should_stop)
    photos = [[str(view.image), view.image.stat().st_mtime_ns] for view in capture.views]
    with run_stage(job, "geometry", stage_fingerprint(job, "geometry", capture_to_json(capture), photos)) as facts:
        if facts is None:
            return
        fit = learn(job, capture, facts)
        scene = Scene(fit.field, fit.background, fit.kind, settings.geometry.levels[-1].step)
        scene.save(project.geometry_file)
        job.artifact("geometry", project.geometry_file)


def _open_project(folder: Path, source: str, capture: Capture, settings: Settings) -> Project:
    """The project with this capture and these settings in it; files that hold them already are left alone."""
    project = Project(folder)
    with project.lock():
        project.create(str(Path(source).absolute()))
        content = capture_to_json(capture)
        if not project.capture_file.exists() or read_json(project.capture_file, "capture") != content:
            write_json(project.capture_file, content)
        state = project.state()
        wanted = state | {"settings": settings_module.to_dict(settings)}
        if wanted != state:
            write_json(project.state_file, wanted)
    return project


def learn(job: Job, capture: Capture, facts: dict) -> Fit:
    """Fit the field level by level, with a preview after each."""
    settings = job.settings.geometry
    views = capture.split("train")
    if len(views) < 3:
        raise DataError(f"{capture.source} has {len(views)} training photos.", "A scene needs at least three.")
    plates = job.plates(views)
    kind = background_kind([_with_alpha(plate) for plate in plates])
    fit = start_fit(make_bank(plates, kind, job), kind, settings, job.runtime)
    progress = job.progress("geometry", sum(level.iterations for level in settings.levels))
    for number, level in enumerate(settings.levels):
        fit.run_level(number, level, progress)
        preview = Scene(fit.field, fit.background, kind, level.step).render(plates[0].camera, 1)
        path = job.project.folder / "preview.png"
        write_png(path, preview.color.cpu().numpy())
        job.emit("preview", path=str(path))
    facts |= {"background": kind, "voxel": fit.field.voxel, "cells": int(fit.field.occupied.sum())}
    return fit


def make_bank(plates: list[Plate], kind: str, job: Job) -> PixelBank:
    """All pixels of the plates, with what the background's kind tells of their opacity."""
    alphas = solids = None
    if kind == "alpha":
        alphas = [np.ones(plate.color.shape[:2]) if plate.alpha is None else plate.alpha for plate in plates]
    if kind in ("black", "white"):
        solids = [solid_pixels(plate.color, kind) for plate in plates]
    valid = None
    if any(plate.valid is not None for plate in plates):
        valid = [np.ones(p.color.shape[:2], bool) if p.valid is None else p.valid for p in plates]
    return PixelBank([p.camera for p in plates], [p.color for p in plates], alphas, solids, valid, job.runtime.device)


def _with_alpha(plate: Plate) -> np.ndarray:
    return plate.color if plate.alpha is None else np.dstack([plate.color, plate.alpha])
