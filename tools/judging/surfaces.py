"""Surfaces of paints: how near palettes come to what they ask for, and what changes beside them.

    .venv/engine/bin/python -m tools.judging.surfaces CAPTURE PROJECT [--sheet SHEET.png]

CAPTURE is laid out like the demo, and PROJECT is what was learned of it. The paint of each object is that of its swatch with
the most pixels. In CIEDE2000 over all colors of an object in the photos: what is asked for, and what the palette leaves of
it; over other paints, what it changes there. Outside: mean squared error of recolored test photos outside the object's true
mask. Last, contrast, which is not offered: what the best palette leaves of it. The sheet shows the test photo of the most pixels of the objects, one picture a surface.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.io.color import ciede2000, linear_to_srgb, srgb_to_lab, srgb_to_linear, to_bytes
from karf_engine.metrics.images import mse_outside
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.matching.fitting import match_pixels
from karf_engine.palettes.matching.paints import pigment_gate
from karf_engine.palettes.matching.surface import LUMINANCE, Surface, surface_target
from karf_engine.palettes.palette import Palette
from karf_engine.palettes.prediction import dominant_color, edited_colors
from karf_engine.palettes.project_edit import ProjectEdit
from karf_engine.recolor.model import Model

from .sheets import write_sheet
from .truth import Truth

SURFACES = (
    Surface(saturation=0),
    Surface(saturation=0.5),
    Surface(saturation=1.5),
    Surface(gloss=0),
    Surface(gloss=0.5),
    Surface(gloss=2),
    Surface(brightness=-0.5),
    Surface(brightness=0.5),
    Surface(brightness=1),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="write pictures of all surfaces")
    options = parser.parse_args()
    model, truth = karf.load(options.project), Truth(options.capture)
    print(f"changed by neutral surfaces: {neutral_change(model)} of 255")
    print("| surface | object | asked for | left | other paints | outside, MSE |\n|---|---|---|---|---|---|")
    for surface in SURFACES:
        for palette in model.palettes:
            figures = judge(model, truth, palette, surface)
            print(f"| {label(surface)} | {palette.name} | {' | '.join(figures)} |")
    for palette in model.palettes:
        print(f"| contrast 0.7 | {palette.name} | {' | '.join(contrast_bound(model, palette, 0.7))} | | |")
    if options.sheet:
        write_sheet(options.sheet, list(sheet(model, truth)))


def label(surface: Surface) -> str:
    """What is not neutral, as text."""
    changed = {name: value for name, value in vars(surface).items() if value != getattr(Surface(), name)}
    return ", ".join(f"{name} {value:g}" for name, value in changed.items())


def swatch_of(model: Model, palette: Palette) -> int:
    """The swatch that is nearest in kind to the color that an object mostly shows, of those with its hue."""
    seen = read_object_colors(model.project.verified(model.project.object_colors_file), palette.name)
    share = pigment_gate(palette.colors, dominant_color(seen)) * (seen.counts @ seen.palette_weights)
    return 1 + int(share[1:].argmax())


def changed(model: Model, edit: ProjectEdit, surface: Surface) -> ProjectEdit:
    """An edit in which the main paint of every object has a surface."""
    for palette in model.palettes:
        edit = edit.surface(palette.name, swatch_of(model, palette), **vars(surface))
    return edit


def neutral_change(model: Model) -> int:
    """The most that neutral surfaces change of a test photo, in steps of 8 bits."""
    view = model.capture.split("test")[0]
    pictures = [model.recolor(view, edit) for edit in (model.edit(), changed(model, model.edit(), Surface()))]
    return int(np.abs(np.subtract(*(to_bytes(each).astype(int) for each in pictures))).max())


def judge(model: Model, truth: Truth, palette: Palette, surface: Surface) -> list[str]:
    """The figures of one object and surface, as text."""
    seen, index = read_object_colors(model.project.object_colors_file, palette.name), swatch_of(model, palette)
    edit = model.edit().surface(palette.name, index, **vars(surface))
    gate = pigment_gate(seen.colors, palette.colors[index])
    target = surface_target(seen.colors, seen.counts, gate, surface)
    reached = edited_colors(seen, palette, edit.colors[palette.name])
    asked, left, beside = (
        ciede2000(srgb_to_lab(one), srgb_to_lab(other))
        for one, other in ((seen.colors, target), (reached, target), (reached, seen.colors))
    )
    others = (gate < 0.05) * seen.counts
    outside = []
    for view, mask in zip(model.capture.split("test"), truth.masks("test")[palette.name], strict=True):
        before, after = (model.recolor(view, each, size="learned") for each in (model.edit(), edit))
        outside.append(mse_outside(after, before, mask))
    return [
        f"{np.average(asked, weights=seen.counts):.1f}",
        f"{np.average(left, weights=seen.counts):.1f}",
        f"{np.average(beside, weights=others):.1f}" if others.sum() else "",
        f"{np.mean(outside):.0e}",
    ]


def contrast_bound(model: Model, palette: Palette, exponent: float) -> list[str]:
    """What light to a power about its mean asks for, and what the palette that is nearest to it leaves, as text."""
    seen = read_object_colors(model.project.object_colors_file, palette.name)
    light = srgb_to_linear(seen.colors)
    luminance = light @ LUMINANCE
    mean = np.average(luminance, weights=seen.counts)
    steeper = np.maximum(luminance / mean, 1e-4) ** (exponent - 1)
    target = np.clip(linear_to_srgb(light * steeper[:, None]), 0, 1)
    colors = match_pixels(seen.palette_weights, seen.colors, target, palette.colors, seen.counts)
    pairs = (seen.colors, target), (edited_colors(seen, palette, colors), target)
    differences = (ciede2000(*map(srgb_to_lab, pair)) for pair in pairs)
    return [f"{np.average(each, weights=seen.counts):.1f}" for each in differences]


def sheet(model: Model, truth: Truth) -> Iterator[list[np.ndarray]]:
    """Rows of three pictures: of the view that shows most of the objects, with each surface."""
    areas = np.sum([[mask.sum() for mask in masks] for masks in truth.masks("test").values()], axis=0)
    view = model.capture.split("test")[int(areas.argmax())]
    pictures = [model.recolor(view, changed(model, model.edit(), surface)) for surface in SURFACES]
    return (pictures[first : first + 3] for first in range(0, len(pictures), 3))


if __name__ == "__main__":
    main()
