"""Learned field and photos -> Gaussians (splats.safetensors), which are rendered from any camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..capture.capture import UNIT_GAINS, Capture, CapturedSplats, View
from ..compute.cores import limit_torch_threads
from ..compute.progress import Emit
from ..errors import BadRequest
from ..fields.files import load_scene
from ..fields.scene_surface import NoSurface
from ..io.files import file_digest
from ..project.settings import to_dict
from ..splats.files import save_gaussians
from ..splats.formats.registry import read_captured_gaussians
from ..splats.gaussians import Gaussians
from ..splats.rasterizer import backend
from ..splats.start import initial_gaussians, pseudo_cameras, render_pseudo_photos, surface_views
from .details import draft_file, learn_details, reached, restore_draft
from .job import Job, open_job, run_stage
from .options import SplatsOptions

VALIDATION_VIEWS = 32


def run(options: SplatsOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Learn Gaussians of a finished scene, or take the capture's.

    Does nothing with 0 iterations, and only warns where nothing can rasterize or the scene has no surface.
    """
    job = open_job(options, emit, should_stop).with_overrides("splats", options.overrides)
    job.project.require("geometry")
    capture = job.capture()
    if capture.splats is not None:
        if options.quality != "draft":
            raise BadRequest(
                f"The splats come from {capture.splats.path}, and are not learned in the quality {options.quality!r}.",
                "Choose the quality draft.",
            )
        _take(job, capture, capture.splats)
        return
    if job.settings.splats.iterations == 0:
        emit("stage", name="splats", text="none are asked for")
        return
    if backend(job.runtime.device) is None:
        emit(
            "warning",
            code="splats",
            sentence="Without the package numba no splats can be learned: other cameras are rendered from the voxels.",
        )
        return
    try:
        if options.quality == "draft":
            _learn(job)
        else:
            _learn_objects(job, options.quality)
    except NoSurface as error:  # photos can be recolored without splats
        emit("warning", code="splats", sentence=f"{error.sentence} There are no splats of it.")


def _learn_objects(job: Job, quality: str) -> None:
    """Learn the objects in detail, after a draft where there is none."""
    if not job.project.finished("segmentation"):
        raise BadRequest(
            f"The quality {quality!r} learns marked objects in detail, and {job.project.folder} has none.",
            "Run the segmentation stage first, or choose the quality draft.",
        )
    if draft_file(job) is None:
        _learn(job)
    learn_details(job, quality)


def _take(job: Job, capture: Capture, splats: CapturedSplats) -> None:
    """Store the Gaussians of another program that came with the capture."""
    with run_stage(job, "splats", file_digest(splats.path)) as run:
        if run is None:
            return
        gaussians = read_captured_gaussians(splats, [view.camera for view in capture.views], job.emit)
        run.summary["gaussians"] = len(gaussians)
        save_gaussians(gaussians, run.output(job.project.splats_file))
    job.artifact("splats", job.project.splats_file)


def _learn(job: Job) -> None:
    from ..splats.fit import SplatFit, load_photos
    from ..splats.visibility import visibility_in_photos

    settings, kept = job.settings.splats, draft_file(job)
    if kept not in (None, job.project.splats_file):
        restore_draft(job, kept)
        return
    with run_stage(job, "splats") as run:
        if run is None:
            job.project.set_settings(to_dict(job.settings))
            return
        capture = job.capture()
        views, test = capture.split("train"), capture.split("test")
        scene = load_scene(job.project.verified(job.project.geometry_file), job.runtime.device)
        photos, seed = load_photos(views, settings.long_side), job.settings.seed
        cameras = pseudo_cameras(scene, [photo.camera for photo in photos], seed)
        steps = len(surface_views(views)) + len(cameras) + settings.iterations + len(photos)
        progress = job.progress("splats", steps)
        start = initial_gaussians(scene, views, settings.count, settings.degree, progress.step)
        between = render_pseudo_photos(scene, cameras, progress.step)
        limit_torch_threads()
        device = job.runtime.device
        job.emit("stage", name="splats", text=f"rasterized by {backend(device)}")
        is_exposed = any(view.gains != UNIT_GAINS for view in views)  # as surface points that photos share tell
        fit = SplatFit(start, photos, settings.iterations, seed, between, device, fits_exposures=is_exposed)
        run.checkpoint.attach(fit, progress)
        fit.run(progress, run.checkpoint)
        run.summary["gaussians"] = len(start)
        judged = test[:: max(1, len(test) // VALIDATION_VIEWS)]
        if judged:
            run.summary["held_out"] = _held_out(job, (start, fit.gaussians), judged, capture, fit.gains)
            run.summary.update(quality="draft", **reached(job, fit.gaussians, judged))
        visibility = visibility_in_photos(fit.gaussians, [photo.camera for photo in photos], progress.step, device)
        save_gaussians(replace(fit.gaussians, visibility=visibility), run.output(job.project.splats_file))
    job.artifact("splats", job.project.splats_file)


def _held_out(
    job: Job, models: Sequence[Gaussians], views: Sequence[View], capture: Capture, gains: np.ndarray
) -> list[list[float]]:
    """Return for each model the mean and worst PSNR of held-out photos in dB, then both with interpolated exposures.

    gains: [n, 3], of the training photos; those of a held-out photo lie between its neighbors' by name.
    """
    from ..splats.fit import interpolate_gains, load_photos, psnr

    place = {name: number for number, name in enumerate(sorted(view.name for view in capture.views))}
    learned = [place[view.name] for view in capture.split("train")]
    gains = gains[np.argsort(learned)]
    own = [interpolate_gains(gains, sorted(learned), place[view.name]) for view in views]
    photos, scores, device = load_photos(views, job.settings.splats.long_side), [], job.runtime.device
    for gaussians in models:
        alike = [psnr(gaussians, [photo], device=device) for photo in photos]
        exposed = [psnr(gaussians, [photo], gain, device) for photo, gain in zip(photos, own, strict=True)]
        mean, worst, *others = (round(float(of(values)), 2) for values in (alike, exposed) for of in (np.mean, np.min))
        text = (
            f"held-out views {mean} dB, the worst {worst} dB; exposed as their neighbors {others[0]} and {others[1]} dB"
        )
        job.emit("stage", name="splats", text=text)
        scores.append([mean, worst, *others])
    return scores
