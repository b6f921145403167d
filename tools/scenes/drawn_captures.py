"""Captures of drawn scenes: which arguments make which folder."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from functools import partial

from ..procedural import full_size
from ..procedural.files import unless_there
from ..procedural.recipe import Extent
from ..procedural.rendering import THIN_SUBPIXELS
from ..procedural.seeded.recipe import make_drawn_capture, make_thin_capture, thin_scene

DRAWING_VERSION = 1  # goes up with every change to the drawn scenes, so that captures of older ones are made again
THIN_VERSION = 1  # likewise, of those with thin parts
SEED_SIZE, THIN_SIZE = 160, 320
THIN_VIEWS = 24, 4  # training and test views
THIN_SAMPLES = 6  # at most: a large photo of few samples, denoised, shows a wire as well


def make_seed_once(seed: int, options: argparse.Namespace) -> None:
    """Make the capture of a drawn scene, unless it is there."""
    size, samples = options.size or SEED_SIZE, options.samples
    arguments = {"seed": seed, "drawing_version": DRAWING_VERSION, "size": size, "samples": samples}
    command = f"python -m tools.scenes.make_captures --out DIR --seeds {seed} --size {size} --samples {samples}"
    make = partial(make_drawn_capture, seed, size, samples, command=command, threads=options.threads)
    unless_there(options.out / f"seed_{seed:03d}", arguments, make)


def make_thin_once(seed: int, options: argparse.Namespace) -> None:
    """Make the capture of a drawn scene of thin parts, unless it is there, and maybe its copy with larger test views."""
    size, views = options.size or THIN_SIZE, options.views or THIN_VIEWS
    extent = Extent(size, *views, min(options.samples, THIN_SAMPLES))
    command = f"python -m tools.scenes.make_captures --out DIR --thin-seeds {seed} --size {size}"
    command += f" --views {extent.train}+{extent.test} --samples {extent.samples}"
    capture = options.out / f"thin_{seed:03d}"
    make = partial(make_thin_capture, seed, extent, command=command, threads=options.threads)
    unless_there(capture, {"thin_seed": seed, "thin_version": THIN_VERSION} | asdict(extent), make)
    if options.full:
        full = replace(full_size.full_size_of(options), subpixels=THIN_SUBPIXELS)
        recipe = thin_scene(seed)[1]
        full_size.enlarge_test_views(recipe, extent, full, capture, options.full / capture.name, options.threads)
