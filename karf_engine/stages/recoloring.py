"""Stage 2b: palettes and surface samples -> F_w (recoloring.safetensors) and the learned palettes. No options."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ..edit.compositing import stack_palettes
from ..edit.palette import Palette, read_palettes, write_palettes
from ..errors import DataError
from ..fields.files import load_scene
from ..fields.protocol import Field
from ..heads.fields import RecoloringField
from ..heads.files import load_segmentation, load_surface, save_recoloring
from ..heads.fit import ObjectRays, fit_recoloring
from ..palette.loco_weights import loco_weights
from ..palette.star_weights import star_weights
from ..progress import Emit
from ..wire import Request
from .job import Job, open_job, run_stage
from .palette import object_pixels, write_object_colors
from .segmentation import view_names

VERSION = 1


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Learn view-consistent palette weights, and adapt the palettes."""
    job = open_job(request, emit, should_stop)
    with run_stage(job, "recoloring", VERSION) as run:
        if run is None:
            return
        scene = load_scene(job.project.checked(job.project.geometry_file), job.runtime.device)
        path = job.project.checked(job.project.segmentation_file)
        segmentation, objects = load_segmentation(path, scene.field.n_features, job.runtime.device)
        initial = palettes_of(job, objects, "initial")
        blocks = initial[:1] if job.settings.palette.shared else initial
        sizes = [len(palette.colors) for palette in blocks]
        settings = job.settings.recoloring
        karf = RecoloringField(segmentation.bounds, scene.field.n_features, sizes, settings).to(job.runtime.device)
        rays = object_rays(job, scene.field, blocks)
        stacked = torch.from_numpy(stack_palettes([p.name for p in blocks], {p.name: p.colors for p in blocks}))
        progress = job.progress("recoloring", settings.iterations)
        learned = fit_recoloring(
            karf,
            scene.field,
            rays,
            stacked.to(job.runtime.device),
            settings,
            job.runtime,
            progress,
            run.unfinished,
        )
        save_recoloring(run.output(job.project.recoloring_file), karf, sizes, settings)
        palettes = _learned_palettes(initial, learned.cpu().numpy(), sizes)
        write_palettes(run.output(job.project.palette_file), palettes, job.settings.palette.shared, initial)
        write_object_colors(run.output(job.project.object_colors_file), palettes, object_pixels(job)[1])
        moved = [float(np.abs(a.colors - b.colors).max()) for a, b in zip(palettes, initial, strict=True)]
        run.facts["palette_moved"] = round(max(moved), 4)
    job.artifact("recoloring", job.project.recoloring_file)


def initial_palettes(job: Job) -> list[Palette]:
    """The palettes as extracted, also where an earlier run has already learned others."""
    return list(read_palettes(job.project.checked(job.project.palette_file), "initial"))


def palettes_of(job: Job, objects: list[str], which: str = "colors") -> list[Palette]:
    """The palettes of these objects, in their order (see `read_palettes`). Raises DataError where there are others."""
    path = job.project.checked(job.project.palette_file)
    palettes = list(read_palettes(path, which))
    names = [palette.name for palette in palettes]
    if names != objects:
        raise DataError(
            f"{path} holds palettes of {', '.join(names):.200}, the segmentation {', '.join(objects):.200}.",
            "Run the palette stage again.",
        )
    return palettes


def object_rays(job: Job, scene_field: Field, blocks: list[Palette]) -> ObjectRays:
    """The rays well inside the objects, with the weights of their photo colors over the objects' palettes."""
    surface, _ = load_surface(job.project.checked(job.project.surface_file), job.runtime.device)
    settings = job.settings.recoloring
    sure = surface.sure
    positions, view = surface.positions[sure], surface.view[sure].long()
    colors = surface.colors[sure].float() / 255
    block = surface.object[sure].long() * (len(blocks) > 1)
    supervised = torch.ones_like(block, dtype=torch.bool)
    if settings.supervision == "reference":
        supervised = torch.isin(view, _reference_views(job).to(colors.device))
    n_colors = max(len(palette.colors) for palette in blocks)
    weights = torch.zeros(len(colors), n_colors, device=colors.device)
    for k, palette in enumerate(blocks):
        own = supervised & (block == k)
        if settings.targets == "loco":
            found = _loco_weights(job, scene_field, positions[own], colors[own], view[own], palette)
        else:
            found = star_weights(colors[own].cpu().numpy(), palette.colors)
        weights[own, : found.shape[1]] = torch.from_numpy(found).to(colors.device)
    return ObjectRays(positions, surface.viewdirs[sure], colors, view, block, weights, supervised)


def _loco_weights(
    job: Job, scene_field: Field, positions: Tensor, colors: Tensor, view: Tensor, palette: Palette
) -> np.ndarray:
    """LoCoPalettes' weights [n, M] of rays with these samples [n, K, 3], colors [n, 3] and views [n]: photo by photo."""
    surface = positions[:, positions.shape[1] // 2]
    features = scene_field.features(surface).cpu().numpy()
    world = scene_field.space.to_world(surface).double().cpu().numpy()
    rgb, number = colors.cpu().numpy(), view.cpu().numpy()
    names, capture = view_names(job, "views"), job.capture()
    if number.max(initial=0) >= len(names):
        raise DataError(f"{job.project.segmentation_report} lacks views.", "Run the segmentation stage again.")
    weights = np.zeros((len(rgb), len(palette.colors)), np.float32)
    progress = job.progress("loco", len(np.unique(number)))
    for n in np.unique(number):
        own = number == n
        camera = capture.view(names[n]).camera.without_distortion()
        places = camera.project(world[own])[0] / max(camera.width, camera.height)
        weights[own] = loco_weights(rgb[own], places, palette.colors, features[own])
        progress.step()
    return weights


def _reference_views(job: Job) -> Tensor:
    """Numbers, among the views that segmentation cached, of those that a mask marks."""
    cached, marked = view_names(job, "views"), view_names(job, "marked")
    return torch.tensor([number for number, name in enumerate(cached) if name in marked], dtype=torch.long)


def _learned_palettes(initial: list[Palette], learned: np.ndarray, sizes: list[int]) -> list[Palette]:
    """Back from blocks to one palette an object; a shared block serves all."""
    palettes = []
    for k, palette in enumerate(initial):
        block = k if len(sizes) > 1 else 0
        palettes.append(Palette(palette.name, learned[block, : sizes[block]].astype(np.float32)))
    return palettes
