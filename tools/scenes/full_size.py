"""A capture as it is, with a few of its test views at a larger size: what recolors of whole photos are judged by.

Cameras, training photos and rough masks are those of the capture, to the byte. The larger test views have photo,
labels, depth and true recolors as before, and the share of each pixel that each object covers.
"""

from __future__ import annotations

import argparse
import shutil
from dataclasses import dataclass
from pathlib import Path

import bpy

from .cameras import View, write_transforms
from .files import write_json
from .recipe import Extent, Recipe, render_edits
from .rendering import render_photos, render_truth, set_up_render

README = """
Larger test views
  {views} of the test views are {size} x {size} pixels (up to {samples} samples per pixel); all else is as above.
  coverage/<object>/test/   share of each pixel that shows the object, 255 = all: {subpixels} x {subpixels} rays a pixel
"""
OF_TEST_VIEWS = (
    "test",
    "labels/test",
    "depth/test",
    "recolor/*/test",
    "coverage/*/test",
    "transforms_test.json",
)


@dataclass(frozen=True)
class FullSize:
    """The larger test views: pixels of a square photo, how many, samples per pixel at most, rays along its side.

    An odd number of rays has one in the middle, whose object is the label.
    """

    size: int
    views: int
    samples: int
    subpixels: int = 5


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that ``full_size_of`` reads."""
    parser.add_argument("--full", type=Path, metavar="DIR", help="copy the capture there with larger test views")
    parser.add_argument("--full-size", type=int, default=1024, help="their width and height (default: %(default)s)")
    parser.add_argument("--full-views", type=int, default=4, help="how many (default: %(default)s)")
    parser.add_argument("--full-samples", type=int, default=12, help="samples per pixel (default: %(default)s)")


def full_size_of(options: argparse.Namespace) -> FullSize:
    """Return what the options ask for."""
    return FullSize(options.full_size, options.full_views, options.full_samples)


def enlarge_test_views(recipe: Recipe, extent: Extent, full: FullSize, source: Path, out: Path, threads: int) -> None:
    """Copy the capture ``source``, made of this recipe and extent, to ``out`` and render its test views larger.

    ``out`` appears when it is complete.
    """
    views = recipe.views(extent.train, extent.test)
    test = spread([view for view in views if view.split == "test"], full.views)
    unfinished = out.with_name(f"{out.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    shutil.copytree(source, unfinished)
    for pattern in OF_TEST_VIEWS:
        for path in unfinished.glob(pattern):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    recipe.build()
    set_up_render(full.size, recipe.field_of_view, threads)
    bpy.context.scene.cycles.denoising_prefilter = "FAST"  # the accurate one takes longer than the samples
    write_transforms(unfinished, [view for view in views if view.split == "train"] + test, recipe.field_of_view)
    render_photos(unfinished, test, full.samples)
    render_truth(unfinished, test, recipe.names, full.subpixels)
    render_edits(recipe, unfinished, test, full.samples)
    with (unfinished / "README.txt").open("a", encoding="utf-8") as readme:
        readme.write(README.format(**vars(full)))
    write_json(unfinished / "full_size.json", vars(full))
    shutil.rmtree(out, ignore_errors=True)
    unfinished.rename(out)


def spread(views: list[View], count: int) -> list[View]:
    """Return ``count`` of the views at regular steps, or all where there are fewer."""
    count = min(count, len(views))
    return [views[int((k + 0.5) * len(views) / count)] for k in range(count)]
