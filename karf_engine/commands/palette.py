"""Stage 2a: object colors -> palettes (palette.json) and color histograms (object_colors.npz)."""

from __future__ import annotations

from collections.abc import Callable

from ..compute.progress import Emit
from ..heads.files import load_surface
from ..heads.training_rays import object_pixels, objects_with_few_pixels
from ..palettes.color_histogram import write_object_colors
from ..palettes.extraction import color_histograms, extract_palettes
from ..palettes.palette import write_palettes
from .job import open_job, run_stage
from .options import PaletteOptions


def run(options: PaletteOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Extract a palette for every segmented object, or one for all of them."""
    job = open_job(options, emit, should_stop)
    with run_stage(job, "palette") as run:
        if run is None:
            return
        surface, objects = load_surface(job.project.verified(job.project.surface_file))
        for name, count in objects_with_few_pixels(surface, objects).items():
            sentence = (
                f"{name!r} shows only {count} pixels in all views, too few for a palette: mark it more generously."
            )
            job.emit("warning", code="scarce", sentence=sentence)
        pixels = object_pixels(surface, objects)
        palettes = extract_palettes(objects, pixels, job.settings.palette, job.settings.seed)
        write_palettes(run.output(job.project.palette_file), palettes, job.settings.palette.shared)
        write_object_colors(run.output(job.project.object_colors_file), color_histograms(palettes, pixels))
        run.summary["colors"] = {palette.name: len(palette.colors) for palette in palettes}
    job.artifact("palette", job.project.palette_file)
