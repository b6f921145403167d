"""The marked objects in detail: a draft's Gaussians, field and photos near their own size -> splats.safetensors."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from ..capture.capture import View
from ..compute.cores import limit_torch_threads
from ..errors import DataError
from ..fields.files import load_scene
from ..heads.files import load_segmentation
from ..recolor.splatted_scene import shares_of_objects
from ..splats.files import load_gaussians, save_gaussians
from ..splats.gaussians import Gaussians
from ..splats.kernels.arrays import LOGIT
from ..splats.sharpness import blur_of, word_for
from .job import Job, run_stage, stage_fingerprint

if TYPE_CHECKING:
    from ..splats.fit import Photo  # needs numba

JUDGED = 8  # views that measure what was reached
JUDGING_ONE = 12  # one photo of this many is judged where none are held out
JUDGED_SIDE = 1600  # their long side, pixels
KEPT = "gaussians", "held_out", "reached", "erased"  # of a draft's summary, with its fingerprint


def draft_file(job: Job) -> Path | None:
    """Return the file of the finished draft with the job's settings; None without one."""
    done, wanted = job.project.finished("splats"), stage_fingerprint(job, "splats")
    if done is None or not job.project.is_intact("splats"):
        return None
    if done["fingerprint"] == wanted:
        return job.project.splats_file
    return job.project.draft_file if done.get("draft", {}).get("fingerprint") == wanted else None


def restore_draft(job: Job, draft: Path) -> None:
    """Make the draft that is kept beside the details the project's splats again."""
    with run_stage(job, "splats") as run:
        if run is not None:
            shutil.copyfile(job.project.verified(draft), run.output(job.project.splats_file))
            run.summary.update(job.project.require("splats")["draft"])
            del run.summary["fingerprint"]


def learn_details(job: Job, quality: str) -> None:
    """Learn the objects in detail, from the finished draft without what was erased of it."""
    from ..splats.details import QUALITIES, DetailFit, iterations_of, load_crops, refined
    from ..splats.visibility import visibility_in_photos

    project, seed, wanted = job.project, job.settings.seed, QUALITIES[quality]
    path, done = draft_file(job), project.require("splats")
    assert path is not None
    with run_stage(job, "splats", *_inputs(job, quality, path)) as run:
        if run is None:
            return
        draft = load_gaussians(project.verified(path))
        is_inside, objects = _objects(job, draft)
        views, judged = _split(job)
        crops = load_crops(views, wanted.long_side, objects)
        if not crops:
            raise DataError(
                f"No photo that is learned shows the objects of {project.folder}, as far as the draft knows.",
                "Mark them again, or choose the quality draft.",
            )
        iterations = iterations_of(crops, wanted)
        progress = job.progress("splats", iterations + len(views))
        limit_torch_threads()
        cameras = [view.camera.without_distortion() for view in views]
        start, n_fine = refined(draft, is_inside, crops, wanted.count, seed)
        fit = DetailFit(start, n_fine, crops, iterations, seed, job.runtime.device)
        run.checkpoint.attach(fit, progress)
        fit.run(progress, run.checkpoint)
        learned = replace(fit.gaussians, n_background=draft.n_background)
        visibility = visibility_in_photos(learned, cameras, progress.step, job.runtime.device)
        save_gaussians(replace(learned, visibility=visibility), run.output(project.splats_file))
        shutil.copyfile(path, run.output(project.draft_file))
        kept = done.get("draft") or {name: done[name] for name in ("fingerprint", *KEPT) if name in done}
        run.summary.update(
            quality=quality, gaussians=len(learned), draft=kept, **reached(job, learned, judged, objects)
        )
    job.artifact("splats", project.splats_file)


def _split(job: Job) -> tuple[Sequence[View], Sequence[View]]:
    """Return the views to learn details from, and those that judge them.

    Without test views every JUDGING_ONE of many photos is left out of the details, not of the draft.
    """
    views, test = job.capture().split("train"), job.capture().split("test")
    if test or len(views) < 2 * JUDGING_ONE:
        return views, test
    judged = views[JUDGING_ONE // 2 :: JUDGING_ONE]
    return [view for view in views if view not in judged], judged


def reached(
    job: Job, gaussians: Gaussians, judged: Sequence[View], objects: Sequence[np.ndarray] | None = None
) -> dict[str, list]:
    """Measure how sharp these views are, around the objects where they are known: the entry `reached` of a summary.

    It has a word, see `word_for`, and the blur in pixels; there is none without views.
    """
    from ..splats.details import load_crops
    from ..splats.fit import load_photos
    from ..splats.rasterizer import rasterize  # needs numba

    if objects is None:
        objects = _objects(job, gaussians)[1] if job.project.finished("segmentation") else []

    def load(views: Sequence[View]) -> list[Photo]:
        return load_crops(views, JUDGED_SIDE, objects) if objects else load_photos(views, JUDGED_SIDE)

    blurs = []
    for view in judged[:: max(1, -(-len(judged) // JUDGED))]:
        for photo in load([view]):
            shown = rasterize(gaussians, photo.camera).picture()
            blurs.append(blur_of(shown, photo.over(gaussians.background), photo.valid))
    if not blurs:
        return {}
    blur = round(float(np.median(blurs)), 2)
    job.emit("stage", name="splats", text=f"new views are {word_for(blur)}, as photos blurred by {blur} pixels")
    return {"reached": [word_for(blur), blur]}


def _inputs(job: Job, quality: str, draft: Path) -> list[str]:
    """Return what the details depend on; the draft's fingerprint does not tell what was erased of it."""
    done = job.project.require("splats")
    erased = [done["files"][draft.name]] if done.get("draft", done).get("erased") else []
    return [quality, job.project.require("segmentation")["fingerprint"], *erased]


@torch.no_grad()
def _objects(job: Job, gaussians: Gaussians) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return which Gaussians are in a box of an object, [n] bool, and the centers of each object's solid ones, [m, 3]."""
    from ..splats.details import OPAQUE

    project = job.project
    scene = load_scene(project.verified(project.geometry_file))
    path, field = project.verified(project.segmentation_file), scene.field
    segmentation, _ = load_segmentation(path, field.n_features, "cpu", field.space)
    centers, n = gaussians.table[:, :3], gaussians.n_foreground
    is_inside = np.zeros(len(gaussians), bool)
    is_inside[:n] = segmentation.inside(field.space.to_grid(torch.from_numpy(centers[:n])).float()).any(1).numpy()
    is_solid = gaussians.table[:, LOGIT] > OPAQUE
    shares = shares_of_objects(gaussians, segmentation, scene)
    return is_inside, [centers[(own > 0.5) & is_solid] for own in shares.T]
