"""A capture with large test photos along an arc: what a picture in motion is made of."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import bpy
from mathutils import Matrix

from .cameras import View, write_transforms
from .recipe import Extent, Recipe
from .rendering import render_photos, set_up_render

KEPT = ("train", "coarse_masks", "transforms_train.json")


def make_film(recipe: Recipe, extent: Extent, capture: Path, out: Path, arc: float, threads: int) -> None:
    """Copy the training photos of a capture to ``out``, and render test photos from cameras that swing round its target.

    Args:
        recipe: of the capture.
        extent: of the new test photos.
        capture: its folder.
        out: a new folder.
        arc: radians by which the cameras swing to either side of the capture's first test view, about the z axis.
        threads: of the processor.
    """
    first = json.loads((capture / "transforms_test.json").read_text(encoding="utf-8"))["frames"][0]
    middle = Matrix(first["transform_matrix"])
    turns = (arc * (2 * number / (extent.test - 1) - 1) for number in range(extent.test))
    swing = [View("test", f"r_{n:03d}", Matrix.Rotation(turn, 4, "Z") @ middle) for n, turn in enumerate(turns)]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    recipe.build()
    set_up_render(extent.size, recipe.field_of_view, threads)
    write_transforms(out, swing, recipe.field_of_view)
    for name in KEPT:
        (shutil.copytree if (capture / name).is_dir() else shutil.copy)(capture / name, out / name)
    render_photos(out, swing, extent.samples)
