"""Stage 2b: palettes, surface samples -> learned palettes, and F_w (recoloring.safetensors) where it is trained."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..compute.progress import Emit
from ..errors import DataError
from ..fields.files import load_scene
from ..fields.protocol import Field
from ..heads.fields import RecoloringField, SegmentationField
from ..heads.files import load_segmentation, load_surface, save_recoloring
from ..heads.fit import ObjectRays, fit_recoloring
from ..heads.rendering import segment_cache
from ..heads.training_rays import ObjectSurface, object_pixels, training_rays
from ..palettes.color_histogram import write_object_colors
from ..palettes.compositing import stack_palettes
from ..palettes.extraction import color_histograms
from ..palettes.palette import Palette, read_palettes, write_palettes
from ..segmentation.coarse_masks import find_masks
from ..segmentation.field_fit import whole_surface
from ..segmentation.report import SegmentationReport
from ..segmentation.views import cache_views, load_masked_views
from .job import Job, StageRun, open_job, run_stage
from .options import RecoloringOptions


def run(options: RecoloringOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Train F_w and adapt the palettes with it; with 0 iterations, keep the palettes as extracted."""
    job = open_job(options, emit, should_stop).with_overrides("recoloring", options.overrides)
    project, is_trained = job.project, job.settings.recoloring.iterations > 0
    with run_stage(job, "recoloring") as run:
        if run is None:
            return
        surface, objects = load_surface(project.verified(project.surface_file), job.runtime.device)
        initial = read_palettes(project.verified(project.output("palette.json", "palette")), "initial", objects)
        palettes = _train(job, run, surface, initial) if is_trained else initial
        write_palettes(run.output(project.palette_file), palettes, job.settings.palette.shared, initial)
        histograms = color_histograms(palettes, object_pixels(surface, objects))
        write_object_colors(run.output(project.object_colors_file), histograms)
        moved = [float(np.abs(a.colors - b.colors).max()) for a, b in zip(palettes, initial, strict=True)]
        run.summary["palette_moved"] = round(max(moved), 4)
    job.artifact("recoloring", project.recoloring_file if is_trained else project.palette_file)


def _train(job: Job, run: StageRun, surface: ObjectSurface, initial: Sequence[Palette]) -> Sequence[Palette]:
    """Train and save F_w; return the palettes learned with it."""
    project, device, settings = job.project, job.runtime.device, job.settings.recoloring
    field = load_scene(project.verified(project.geometry_file), device).field
    segmentation, objects = load_segmentation(project.verified(project.segmentation_file), field.n_features, device)
    blocks = initial[:1] if job.settings.palette.shared else initial
    sizes = [len(palette.colors) for palette in blocks]
    bounds = segmentation.bounds
    assert isinstance(bounds, Tensor)
    karf = RecoloringField(bounds, field.n_features, sizes, settings).to(device)
    if settings.background == "black":
        everything, opacity = whole_scene(job, field, segmentation)
        rays = rays_of(job, field, everything, blocks, opacity)
    else:
        rays = rays_of(job, field, surface, blocks)
    stacked = torch.from_numpy(stack_palettes([p.name for p in blocks], {p.name: p.colors for p in blocks}))
    progress = job.progress("recoloring", settings.iterations)
    learned = fit_recoloring(karf, field, rays, stacked.to(device), settings, job.runtime, progress, run.checkpoint)
    save_recoloring(run.output(project.recoloring_file), karf, sizes, settings)
    colors = [block[:size] for block, size in zip(learned.cpu().numpy(), sizes, strict=True)]
    colors *= len(objects) // len(blocks)  # a single block serves all objects
    return [Palette(name, own) for name, own in zip(objects, colors, strict=True)]


def whole_scene(job: Job, field: Field, segmentation: SegmentationField) -> tuple[ObjectSurface, Tensor]:
    """Return all rays of the segmentation's views and their opacity; the stage stored only those of objects."""
    capture, settings = job.capture(), job.settings.segmentation
    report = SegmentationReport.read(job.project.verified(job.project.segmentation_report))
    masks = find_masks(job.project.check_inside(job.project.masks_folder), capture)
    views = [capture.view(name) for name in report.views]
    masked = load_masked_views(masks, views, job.settings.geometry.long_side, settings, report.objects)
    if masked.names != report.views:
        raise DataError(f"{job.project.segmentation_report} names other views.", "Run the segmentation stage again.")
    cached = cache_views(field, masked, settings.samples_per_ray, job.progress("surface", masked.n_pixels))
    return whole_surface(cached, segment_cache(segmentation, field, cached.cache)), cached.cache.opacity


def rays_of(
    job: Job, field: Field, surface: ObjectSurface, blocks: Sequence[Palette], opacity: Tensor | None = None
) -> ObjectRays:
    """Return the training rays of F_w. opacity: [n], of the rays of the surface; None for opaque ones."""
    settings = job.settings.recoloring
    masked_views: list[int] = []
    cameras: list[Camera] = []
    if settings.supervision == "reference" or settings.targets == "loco":
        path = job.project.verified(job.project.segmentation_report)
        report = SegmentationReport.read(path)
        masked_views = [number for number, name in enumerate(report.views) if name in report.masked_views]
        if max(surface.view.tolist(), default=0) >= len(report.views):
            raise DataError(f"{path} lacks views.", "Run the segmentation stage again.")
        if settings.targets == "loco":
            capture = job.capture()
            cameras = [capture.view(name).camera for name in report.views]
    return training_rays(field, surface, blocks, settings, masked_views, cameras, job.progress, opacity)
