"""Stage 2a: the objects' colors -> palettes (palette.json) and color histograms (object_colors.npz). No options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..edit.palette import Palette, write_palettes
from ..errors import DataError
from ..files import atomic_write
from ..heads.files import load_surface
from ..palette.hull import cell_support, color_cells, extract_palette
from ..palette.star_weights import star_weights
from ..progress import Emit
from ..settings import PaletteSettings
from ..wire import Request
from .job import Job, open_job, run_stage
from .segmentation import MIN_SURE_PIXELS

VERSION = 1


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Extract a palette for every segmented object, or one for all of them."""
    job = open_job(request, emit, should_stop)
    with run_stage(job, "palette", VERSION) as run:
        if run is None:
            return
        names, pixels = object_pixels(job)
        palettes = extract_palettes(names, pixels, job.settings.palette, job.settings.seed)
        write_palettes(run.output(job.project.palette_file), palettes, job.settings.palette.shared)
        write_object_colors(run.output(job.project.object_colors_file), palettes, pixels)
        run.facts["colors"] = {palette.name: len(palette.colors) for palette in palettes}
    job.artifact("palette", job.project.palette_file)


def object_pixels(job: Job) -> tuple[list[str], list[list[np.ndarray]]]:
    """Objects' names and, for each, the photo colors well inside it, one array [n, 3] in [0, 1] a view.

    Raises DataError where an object shows too few pixels to speak of a palette.
    """
    surface, objects = load_surface(job.project.checked(job.project.surface_file))
    colors = surface.colors.numpy().astype(np.float32) / 255
    owner, view, sure = surface.object.numpy(), surface.view.numpy(), surface.sure.numpy()
    pixels = []
    for k, name in enumerate(objects):
        chosen = (owner == k) & sure
        if chosen.sum() < MIN_SURE_PIXELS:
            raise DataError(f"{name!r} shows only {int(chosen.sum())} pixels in all views.", "Mark it more generously.")
        pixels.append([colors[chosen & (view == v)] for v in np.unique(view[chosen])])
    return objects, pixels


def extract_palettes(
    names: list[str], pixels: list[list[np.ndarray]], settings: PaletteSettings, seed: int = 0
) -> list[Palette]:
    """One palette an object; with `shared` the same one for all, from all their colors. seed: of a random start."""
    random = np.random.default_rng(seed)
    groups = [[view for own in pixels for view in own]] if settings.shared else pixels
    found = []
    for views in groups:
        cells, counts = color_cells(np.concatenate(views))
        colors = extract_palette(
            cells, counts, settings.colors or None, settings.tolerance, support=cell_support(cells, views)
        )
        if settings.start == "random":
            colors = np.concatenate([colors[:1], random.random((len(colors) - 1, 3), np.float32)])
        found.append(colors)
    return [Palette(name, found[0 if settings.shared else k]) for k, name in enumerate(names)]


def write_object_colors(path: Path, palettes: list[Palette], pixels: list[list[np.ndarray]]) -> None:
    """Each object's color histogram with its palette weights: what "this color becomes that color" is solved on."""
    arrays = {}
    for palette, views in zip(palettes, pixels, strict=True):
        cells, counts = color_cells(np.concatenate(views))
        arrays[f"{palette.name}/colors"] = cells.astype(np.float32)
        arrays[f"{palette.name}/counts"] = counts
        arrays[f"{palette.name}/palette_weights"] = star_weights(cells, palette.colors)
    atomic_write(path, lambda temporary: np.savez_compressed(temporary, **arrays))
