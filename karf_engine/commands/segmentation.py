"""Stage 1: coarse masks -> F_s (segmentation.safetensors), the objects' rays (surface.safetensors) and a report."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import numpy as np
import torch

from ..capture.capture import UNIT_GAINS
from ..capture.reader_utils import read_bytes
from ..compute.progress import Emit
from ..fields.files import load_scene
from ..fields.protocol import Field
from ..heads.fields import SegmentationField, Volumes
from ..heads.files import save_segmentation, save_surface
from ..heads.rendering import segment_cache
from ..io.color import to_bytes
from ..io.files import file_digest
from ..project.volumes import read_volumes
from ..segmentation.coarse_masks import CoarseMask, copy_masks, find_masks
from ..segmentation.corrections import ViewObserver, find_corrections
from ..segmentation.field_fit import fit_segmentation, object_surface
from ..segmentation.labels import LabelledSurface, LabelProblem, solve_labels
from ..segmentation.report import report_of
from ..segmentation.surface_points import SurfaceUncertainty, surface_points
from ..segmentation.views import CachedViews, cache_views, load_masked_views, votes_of_rays
from .job import Job, StageRun, open_job, run_stage
from .options import SegmentationOptions

# entries of the fingerprint, for results that differ from earlier versions'
WITHIN = "F_s"  # volumes bound F_s
EXPOSED_ALIKE = "photos in their mean exposure"
ALL_RAYS = "uniform"  # ray sampling of Eq. 12


def run(options: SegmentationOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Segment the objects of the given masks in the whole capture."""
    job = open_job(options, emit, should_stop)
    job.project.require("geometry")
    capture = job.capture()
    folder = job.project.check_inside(options.masks or job.project.masks_folder)
    masks = find_masks(folder, capture)
    corrections = find_corrections(
        job.project.check_inside(options.corrections or job.project.corrections_folder), capture
    )
    volumes_file = options.volumes or job.project.volumes_file
    volumes = read_volumes(volumes_file)
    # without corrections and volumes, the fingerprint is the same as before these features
    inputs = [_digests(marks) for marks in (masks, corrections) if marks]
    inputs += [file_digest(volumes_file), WITHIN] if volumes else []
    inputs += [ALL_RAYS] if job.settings.segmentation.labels == "masks" else []
    inputs += [EXPOSED_ALIKE] if any(view.gains != UNIT_GAINS for view in capture.views) else []
    with run_stage(job, "segmentation", *inputs) as run:
        if run is None:
            return
        long_side, settings = job.settings.geometry.long_side, job.settings.segmentation
        field = load_scene(job.project.verified(job.project.geometry_file), job.runtime.device).field
        views = load_masked_views(masks, capture.views, long_side, settings, {c.object_name for c in corrections})
        cached = cache_views(field, views, settings.samples_per_ray, job.progress("surface", views.n_pixels))
        votes = votes_of_rays(cached)
        points, objects = surface_points(cached, field.voxel), views.objects
        constraints = ViewObserver(field, points, long_side).constraints(corrections, objects)
        random = np.random.default_rng(job.settings.seed)
        problem = LabelProblem(field, objects, points, votes, constraints, volumes, settings.rounds, random, job.emit)
        surface = solve_labels(settings.labels, problem)
        progress = job.progress("segmentation", settings.iterations)
        karf = fit_segmentation(field, cached, votes, surface, settings, job.runtime, progress, run.checkpoint)
        if volumes:  # the labels are bounded by them, but F_s extrapolates smoothly
            karf.volumes = Volumes.from_objects(volumes, surface.objects).to(job.runtime.device)
            karf.space = field.space
        _write(job, run, karf, field, cached, surface)
        if folder.resolve() != job.project.masks_folder.resolve():
            copy_masks(masks, run.output(job.project.path("masks")))
    job.artifact("segmentation", job.project.segmentation_file)


def _digests(marks: list[CoarseMask]) -> list:
    return [[mark.object_name, mark.view.name, hashlib.sha256(read_bytes(mark.path)).hexdigest()] for mark in marks]


def _write(
    job: Job, run: StageRun, karf: SegmentationField, field: Field, cached: CachedViews, surface: LabelledSurface
) -> None:
    """Write F_s, its surface samples of the objects, the labels' uncertainty, and the report."""
    settings, objects = job.settings.segmentation, cached.views.objects
    probabilities = segment_cache(karf, field, cached.cache)
    save_segmentation(run.output(job.project.segmentation_file), karf, objects, settings)
    save_surface(run.output(job.project.surface_file), object_surface(cached, probabilities), objects, settings)
    points = torch.from_numpy(surface.points.positions).float().to(job.runtime.device)
    world = field.space.to_world(points).float().cpu().numpy()
    doubts = SurfaceUncertainty(objects, world, to_bytes(surface.labels.doubt))
    doubts.write(run.output(job.project.uncertainty_file))
    report = report_of(cached, surface.points, surface.labels, probabilities, world)
    report.write(run.output(job.project.segmentation_report))
    run.summary["objects"] = objects
