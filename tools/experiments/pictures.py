"""What the tables look like: strips of pictures of one test view, for docs/results.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from karf_engine.io.color import to_bytes
from tools.metrics.scores import palette_picture

from ..judging.sheets import difference, tinted
from ..judging.views import TestViews
from .bench import PLAIN, Bench
from .recolors import global_recolor, kmeans_recolor, masked_hue_shift, projected, true_masks_of

MARGIN = 8  # pixels round the objects
GAIN = 4  # of shown errors
GAP = 4  # white pixels between pictures
QUALITY = 92  # of the JPEG file


@dataclass(frozen=True)
class Strip:
    """rows of pictures [H, W, 3] of one size, and what they show."""

    caption: str
    rows: list[list[np.ndarray]]

    def write(self, path: Path) -> None:
        """Write the rows as one picture."""
        gaps = [(0, GAP), (0, GAP), (0, 0)]
        rows = [np.concatenate([np.pad(p, gaps, constant_values=1) for p in row], 1) for row in self.rows]
        iio.imwrite(path, to_bytes(np.concatenate(rows, 0)[:-GAP, :-GAP]), quality=QUALITY)


class View:
    """The test view that shows the least visible object best."""

    def __init__(self, bench: Bench) -> None:
        masks = true_masks_of(bench, bench.model)
        self.number = int(np.argmax([mask.sum((1, 2)).min() for mask in masks]))
        self.masks = masks[self.number]
        self.photo = bench.photos()[self.number]
        sides = [np.flatnonzero(self.masks.any((0, axis))) for axis in (2, 1)]
        self.window = tuple(slice(max(0, side[0] - MARGIN), side[-1] + MARGIN) for side in sides)

    def cut(self, picture: np.ndarray) -> np.ndarray:
        """The part of a picture round the objects."""
        return picture[self.window]

    def only_objects(self, picture: np.ndarray) -> np.ndarray:
        """That part, all else black."""
        return self.cut(picture * self.masks.any(0)[..., None])


def segmentation_strip(bench: Bench) -> Strip:
    """Table 1."""
    view = View(bench)
    plain = bench.learned((PLAIN,), weights_from="field").frames[view.number]
    ours = bench.ours().frames[view.number]
    row = [view.photo, tinted(view.photo, ours.masks)]
    row += [difference(view.photo, frame.masks, view.masks) for frame in (ours, plain)]
    return Strip(
        "A test photo; our masks of it; what ours cover too much of (red) and miss (blue); the same of plain "
        "cross-entropy on the rough masks.",
        [[view.cut(picture) for picture in row]],
    )


def ablations_strip(bench: Bench) -> Strip:
    """Fig. 7 and 8."""
    view = View(bench)
    ways: dict[str, tuple[str, ...]] = {
        "w/ All": (),
        "B-spline layers": ("recoloring.layer=bspline",),
        "MLP layers of equal width": ("recoloring.layer=mlp",),
        "without L_Palette": ("recoloring.palette_loss=0",),
        "without L_Weight": ("recoloring.weight_loss=0",),
    }
    photo = view.only_objects(view.photo)
    shown = [view.only_objects(mixture(bench.ablation(overrides, 0), view)) for overrides in ways.values()]
    errors = [GAIN * np.abs(picture - photo) for picture in shown]
    return Strip(
        f"The objects of a test photo, and as W P shows them: {', '.join(ways)}. Below, the differences to the photo, "
        f"{GAIN} times.",
        [[photo, *shown], [np.zeros_like(photo), *errors]],
    )


def mixture(learned: TestViews, view: View) -> np.ndarray:
    """Each object as its palette mixes it, in the true masks, [H, W, 3]."""
    frame = learned.frames[view.number]
    mixed = palette_picture(frame.palette_weights, frame.probabilities, learned.model.learned_colors)
    return (mixed * view.masks[..., None]).sum(0)


def edits_strip(bench: Bench) -> Strip:
    """Fig. 5, beside the truth and what others would give."""
    view = View(bench)
    ours = bench.ours()
    ways = {
        "ours": projected(bench, ours, "photo"),
        "the paper's replacement": projected(bench, ours, "field", "paper"),
        "k-means": kmeans_recolor(bench),
        "one palette of whole pictures": global_recolor(bench),
        "a hue shift in our masks": masked_hue_shift(bench, [frame.masks for frame in bench.ours().frames]),
    }
    rows = []
    for edit in bench.truth.edits:
        true = bench.truth.recolored(edit)[view.number]
        row = [view.photo, true, *(recolor(edit)[view.number] for recolor in ways.values())]
        rows.append([view.cut(picture) for picture in row])
    return Strip(f"A test photo, its true recolor, and: {', '.join(ways)}. A row for each edit.", rows)


STRIPS: dict[str, Callable[[Bench], Strip]] = {
    "segmentation": segmentation_strip,
    "ablations": ablations_strip,
    "edits": edits_strip,
}
