"""Time a swatch's drag in Blender on made-up planes: python -m tools.evaluate.swatch_in_blender WIDTH HEIGHT.

Prints the median processor milliseconds from setting the color to the pixels in the image, without the upload to the
graphics card when the editor is drawn. Every pixel of the picture belongs to the object.
"""

from __future__ import annotations

import importlib
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from .sources import ROOT

MODULE = "bl_ext.karf_bench.karf"
COLORS, CELLS, REPEATS = 6, 4000, 40  # of the palette, of its histogram, drags


def main() -> None:
    width, height = map(int, sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        enable(Path(folder) / "repository")
        scene = displayed_scene(Path(folder) / "project", width, height)
        swatch, times = scene.karf.objects[0].swatches[1], []
        for turn in range(REPEATS):
            start = time.process_time()
            swatch.color = (turn / REPEATS, 0.5, 1 - turn / REPEATS)
            times.append(1000 * (time.process_time() - start))
    print(json.dumps(round(statistics.median(times), 2)), flush=True)


def part(name: str):
    """Return a module of the extension or of the engine within it."""
    return importlib.import_module(f"{MODULE}.{name}")


def enable(repository: Path) -> None:
    """Enable the checkout as an extension."""
    repository.mkdir()
    (repository / "karf").symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(name="bench", module="karf_bench", custom_directory=str(repository))
    bpy.ops.preferences.addon_enable(module=MODULE)


def displayed_scene(project: Path, width: int, height: int) -> bpy.types.Scene:
    """Return a scene that displays a made-up view."""
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32) / max(height, width)
    weights = np.stack([1 + np.sin(6 * rows * (j + 1) + 9 * columns) for j in range(COLORS)])[None]
    weights /= weights.sum((0, 1))
    base = np.stack([rows, columns, 1 - rows], -1)
    compositing, palette = part("karf_engine.palettes.compositing"), part("karf_engine.palettes.palette")
    compositing.write_planes(
        project / "planes" / "view.npz",
        compositing.Planes(("thing",), weights, weights.sum(1), np.rint(base * 255).astype(np.uint8)),
        part("karf_engine.project.state").result_fingerprint({}, "recoloring"),
    )
    ramp = np.linspace(0, 1, COLORS, dtype=np.float32)[:, None] * np.float32([0.9, 0.4, 0.2])
    scene = bpy.context.scene
    scene.karf.project = str(project)
    scene.karf.views.add().name = "view"
    scene.karf.active_view = "view"
    part("karf_blender.swatches.palettes").load_palettes(scene, [palette.Palette("thing", ramp)])
    histogram = part("karf_engine.palettes.color_histogram")
    pixels = np.random.default_rng(0).integers(height * width, size=CELLS)
    seen = np.maximum(weights[0].reshape(COLORS, -1).T[pixels], 1e-6)
    colors = histogram.ColorHistogram(seen @ ramp, np.ones(CELLS), seen / seen.sum(1, keepdims=True))
    part("karf_engine.project").Project(project).create("made up")
    histogram.write_object_colors(project / "object_colors.npz", {"thing": colors})
    part("karf_blender.swatches.displayed").of(scene).recolor()
    return scene


if __name__ == "__main__":
    main()
    os._exit(0)  # bpy may hang at the interpreter's exit
