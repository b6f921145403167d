"""What the panels predict of an edit, beside what it is worth in pictures whose truth is known:

    python -m tools.judging.predictions CAPTURE PROJECT [CAPTURE PROJECT ...] [--json FILE]

The edit is that of one who knows one color pair an object, read in the reference view. For each of its objects

    left       what the panel says is left: of the object's colors in the photos, to what the pair asks of them
    asked      the same in the test views: of the recolored pixels in the true masks, to what the pair asks of these
    true       of the recolored pixels in the true masks, to the true recolor
    color      what colorways say of the picked color alone: the color reached, to the target
    in views   the same, measured in the true masks of the test views

all as mean CIEDE2000; then median and mean of the absolute differences between predicted and measured.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.io.files import write_json
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.matching.becomes import residual_delta_e
from karf_engine.palettes.prediction import edited_colors, evaluate_edit, reached_color
from karf_engine.recolor.model import Model

from .recolors import edit_to_judge
from .truth import Truth


@dataclass(frozen=True)
class PredictedAndReached:
    """Of an object of an edit what was predicted and what was reached, mean CIEDE2000; see above."""

    left: float
    asked: float
    true: float
    color: float
    in_views: float


GAPS = {  # title -> what was predicted, and what was measured
    "left - asked": ("left", "asked"),
    "left - true": ("left", "true"),
    "color - in views": ("color", "in_views"),
}


def predictions(model: Model, truth: Truth) -> dict[str, PredictedAndReached]:
    """By edit and object."""
    frames = [model.preview(view) for view in model.capture.split("test")]
    photos = [frame.base for frame in frames]
    found = {}
    for name, edit in truth.edits.items():
        judged = edit_to_judge(model, truth, name)
        ours, true = [model.composite(frame, judged) for frame in frames], truth.recolored(name)
        for key in edit["objects"]:
            masks = truth.masks("test")[key]
            pixels = [_inside(pictures, masks) for pictures in (photos, ours, true)]
            if len(pixels[0]):
                found[f"{name}, {key}"] = _of_object(
                    model, key, judged.colors[key], truth.color_pair(name, key), *pixels
                )
    return found


def _inside(pictures: list[np.ndarray], masks: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([picture[mask] for picture, mask in zip(pictures, masks, strict=True)]).astype(np.float64)


def _of_object(
    model: Model,
    name: str,
    edited: np.ndarray,
    pair: tuple[np.ndarray, np.ndarray],
    photos: np.ndarray,
    ours: np.ndarray,
    true: np.ndarray,
) -> PredictedAndReached:
    """photos, ours, true: the object's pixels in the test views, sRGB [n, 3]."""
    (palette,) = (palette for palette in model.palettes if palette.name == name)
    seen = read_object_colors(model.project.verified(model.project.object_colors_file), name)
    after = edited_colors(seen, palette, edited)
    wanted = srgb_to_lab(pair[1])
    in_views = reached_color(photos, ours, pair[0])
    return PredictedAndReached(
        left=residual_delta_e(seen.colors, after, seen.counts, *pair),
        asked=residual_delta_e(photos, ours, np.ones(len(photos)), *pair),
        true=float(ciede2000(srgb_to_lab(ours), srgb_to_lab(true)).mean()),
        color=evaluate_edit(edited, palette.colors, seen, pair[0], wanted)[1],
        in_views=float(ciede2000(srgb_to_lab(in_views), wanted)),
    )


def gaps(rows: list[PredictedAndReached]) -> dict[str, tuple[float, float]]:
    """Median and mean of the absolute gap between predicted and measured, by title."""
    absolute = {
        title: [abs(getattr(r, first) - getattr(r, second)) for r in rows] for title, (first, second) in GAPS.items()
    }
    return {title: (float(np.median(values)), float(np.mean(values))) for title, values in absolute.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folders", nargs="+", type=Path, metavar="CAPTURE PROJECT", help="a capture like the demo, learned"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows there")
    options = parser.parse_args()
    if len(options.folders) % 2:
        parser.error("give a project for each capture")
    rows = {}
    for capture, project in zip(options.folders[::2], options.folders[1::2], strict=True):
        for key, row in predictions(karf.load(project), Truth(capture)).items():
            rows[f"{capture.name}: {key}"] = row
            print(
                f"{capture.name}: {key}",
                *(f"{figure} {value:.2f}" for figure, value in asdict(row).items()),
                flush=True,
            )
    for title, (median, mean) in gaps(list(rows.values())).items():
        print(f"|{title}|: median {median:.2f}, mean {mean:.2f}, of {len(rows)}")
    if options.json:
        write_json(options.json, {key: asdict(row) for key, row in rows.items()})


if __name__ == "__main__":
    main()
