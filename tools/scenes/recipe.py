"""A recipe says what a capture shows; here it becomes files."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .cameras import View, write_transforms
from .files import write_json
from .masks import draw_masks, reference_view
from .materials import set_colors
from .rendering import render_photos, render_truth, set_up_render

STEPS = ("photos", "truth", "recolors", "masks")

README = """\
{title}
================================================================================================

Rendered with Cycles from a procedural scene; public domain (CC0 1.0). Made by
    {command}
(bpy {blender}, {size} x {size} pixels, up to {samples} samples per pixel, denoised, view transform Standard).

What is where
  transforms_train.json, transforms_test.json   cameras, NeRF-synthetic layout (file_path has no extension)
  train/r_000{suffix} ...       {train} training photos, 8-bit sRGB, no alpha
  test/r_000{suffix} ...        {test} test photos, their directions lie between those of the training photos
  labels/<split>/r_000.png  object id of each pixel (palette image, pixel value = id), one ray per pixel center
  labels/names.json         object name -> id; 0 is everything else
  depth/test/r_000.png      16-bit depth along the camera axis in steps of 0.001 scene units; 65535 = nothing there
  recolor/<edit>/test/      the test photos with only the materials' base colors changed (same light, same seed)
  recolor/<edit>/train/     the same for one training photo, the reference view {reference}
  edits.json                edit -> the objects it changes and its reference view
  coarse_masks/one/<object>/    one rough mask of each object (0 or 255), named after its training view
  coarse_masks/three/<object>/  the same mask and two more, from far-apart sides

Conventions
  camera_to_world matrices are 4x4, camera axes x right, y up, looking down -z; the world has z up.
  Pinhole, square pixels, camera_angle_x in radians, principal point at the center of the image.
  Pixel corners lie at integers, pixel centers at +0.5. Lengths are scene units; {place}

Edits
{edits} A true recolor also changes the light that the object reflects
  onto its surroundings, so a recolored render differs slightly from the photo outside the object.

Coarse masks
  Made from the true labels by coarse_mask() of the tool: the signed distance to the border plus smooth noise (cells
  of 12 pixels, deviation 2.6 pixels) and a constant shift, thresholded at 0. "spill": a disk added across the border
  onto another marked object. "gap": a disk cut out at the border. IoU is against the true label.

{masks}
"""


@dataclass(frozen=True)
class TrueEdit:
    """One recoloring: the objects it changes, and their new paints, material -> slot -> color."""

    objects: tuple[str, ...]
    colors: dict[str, dict[str, tuple[float, float, float]]]


@dataclass(frozen=True)
class Recipe:
    """The content of a capture.

    build: adds everything to an empty file. views: numbers of training and test views. names: object with masks -> id.
    flaws: (object, place in its three views) -> deliberate fault of that coarse mask. title, place, about_edits: texts
    of the README.
    """

    title: str
    place: str
    about_edits: str
    build: Callable[[], None]
    views: Callable[[int, int], list[View]]
    field_of_view: float
    names: dict[str, int]
    edits: dict[str, TrueEdit]
    flaws: dict[tuple[str, int], str] = field(default_factory=dict)


@dataclass(frozen=True)
class Extent:
    """Size of a rendering: pixels of a square photo, views, samples per pixel at most; and the suffix of photos."""

    size: int
    train: int
    test: int
    samples: int
    suffix: str = ".png"


def make_capture(
    recipe: Recipe, extent: Extent, out: Path, command: str, threads: int, steps: Collection[str] = STEPS
) -> None:
    """Render a capture into ``out``, or the named steps; later steps read the labels of the ``truth`` step.

    ``command`` is what the README says it was made by.
    """
    views = recipe.views(extent.train, extent.test)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    recipe.build()
    set_up_render(extent.size, recipe.field_of_view, threads)
    if "photos" in steps:
        write_transforms(out, views, recipe.field_of_view)
        render_photos(out, views, extent.samples, extent.suffix)
    if "truth" in steps:
        render_truth(out, views, recipe.names)
    if "recolors" in steps:
        render_recolors(recipe, out, views, extent)
    if "masks" in steps:
        table = draw_masks(out, views, recipe.names, recipe.flaws)
        write_readme(recipe, extent, out, views, command, table)
        print(table, flush=True)


def render_recolors(recipe: Recipe, out: Path, views: list[View], extent: Extent) -> None:
    """Render the true recolors of all test views and of the reference view, and write ``edits.json``."""
    reference = reference_view(out, views, recipe.names)
    render_edits(recipe, out, [view for view in views if view.split == "test" or view == reference], extent)
    edits = {
        name: {"objects": list(edit.objects), "reference_view": reference.stem} for name, edit in recipe.edits.items()
    }
    write_json(out / "edits.json", {"edits": edits})


def render_edits(recipe: Recipe, out: Path, views: list[View], extent: Extent) -> None:
    """Render these views in the paints of each edit."""
    for name, edit in recipe.edits.items():
        before = set_colors(edit.colors)
        render_photos(out / "recolor" / name, views, extent.samples, extent.suffix)
        set_colors(before)


def write_readme(recipe: Recipe, extent: Extent, out: Path, views: list[View], command: str, masks: str) -> None:
    """Write ``README.txt`` with the facts of this run and the table of the coarse masks."""
    text = README.format(
        title=recipe.title,
        command=command,
        blender=bpy.app.version_string,
        size=extent.size,
        samples=extent.samples,
        suffix=extent.suffix,
        train=extent.train,
        test=extent.test,
        reference=reference_view(out, views, recipe.names).stem,
        place=recipe.place,
        edits=recipe.about_edits,
        masks=masks,
    )
    (out / "README.txt").write_text(text, encoding="utf-8")
