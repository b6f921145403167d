"""What lies between a recolor and the truth, split by cause:

    python -m tools.judging.causes CAPTURE PROJECT [--per-paint]

The same pixels are recolored in five ways, each of which lacks one thing less than the one before: ours; ours in the
true masks; the swatches that come nearest to the true recolors; the same with a palette made of the true pixels; any
function of a pixel's color. What each gains is a cause, and what the last one lacks is the light: so the causes add up.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

import karf_engine as karf
from karf_engine.io.color import ciede2000, srgb_to_lab, to_bytes
from karf_engine.palettes.added import append_added_sets, split_weights
from karf_engine.palettes.color_histogram import cell_index, color_cells
from karf_engine.palettes.extraction import extract_palette
from karf_engine.palettes.matching.fitting import bounded_least_squares, bounds
from karf_engine.palettes.palette import MAX_SRGB, AddedColor, Edit
from karf_engine.palettes.palette_weights import palette_weights_of_image
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from .recolors import edit_to_judge
from .truth import Truth

MAX_COLORS = 16  # of a palette made of the true pixels, which leaves none of them outside where it can
ROUNDS = 6  # of least squares, from sRGB towards CIEDE2000
EDGE = 0.5  # pixels, the deviation of the Gaussian that makes a true mask the coverage of pixels


@dataclass(frozen=True)
class Causes:
    """Mean CIEDE2000 in the true masks of an edit's objects, means over the views that show them.

    Attributes:
        ours: The distance that is split: mask + rule + palette + weights + light.
        true_masks: Of the same edit in the true masks, whose edges are as soft as the pixels.
        bound: In the true masks, of the best possible swatches: those that come nearest to the true recolors of these
            very views, which nobody can know.
        mask: What our masks lose: ours less `true_masks`. Below 0 where they leave out what keeps its paint.
        rule: What the rule loses that chose the swatches: `true_masks` less `bound`.
        palette: What the learned palette loses: the bound less that of a palette of up to 16 colors made of the true pixels.
        weights: What a pixel's weights by that palette lose against any function of the pixel's color.
        light: What no such function can do, as pixels of one color become different ones: mirrored surroundings, light
            from other things, noise.
    """

    ours: float
    true_masks: float
    bound: float
    mask: float
    rule: float
    palette: float
    weights: float
    light: float


@dataclass(frozen=True)
class Pixels:
    """All n pixels of an object in the test views.

    Attributes:
        photo: sRGB [n, 3].
        ours: Our recolor, [n, 3].
        true: The true one, [n, 3].
        coverage: The object's share of each pixel, [n, 1].
        view: Number [n] of each pixel's view.
    """

    photo: np.ndarray
    ours: np.ndarray
    true: np.ndarray
    coverage: np.ndarray
    view: np.ndarray

    def difference(self, recolor: np.ndarray) -> np.ndarray:
        """CIEDE2000 [n] of a recolor [n, 3] to the true one."""
        return ciede2000(srgb_to_lab(np.clip(recolor, 0, 1)), srgb_to_lab(self.true))


def split_by_cause(model: Model, truth: Truth, frames: Sequence[Frame], edit: Edit, name: str) -> dict[str, Causes]:
    """The causes of an edit, in each of its objects that test views show and, as `all`, in all of them together.

    Args:
        model: Learned of the capture.
        truth: Of the capture.
        frames: Of the test views, whose base is the photo, with palette weights of the photo's colors.
        edit: Ours.
        name: Of the true edit that it is judged by.
    """
    pictures = [model.composite(frame, edit) for frame in frames]
    return split_in(model, truth, [frame.base for frame in frames], pictures, edit, name)


def split_in(
    model: Model,
    truth: Truth,
    photos: list[np.ndarray],
    pictures: list[np.ndarray],
    edit: Edit,
    name: str,
    within: list[np.ndarray] | None = None,
) -> dict[str, Causes]:
    """The same of any test pictures.

    Args:
        model: As of `split_by_cause`, as are truth, edit and name.
        truth: Whose masks are as large as the pictures.
        photos: Before the edit, [H, W, 3] each.
        pictures: Ours.
        edit: That made them.
        name: Of the true edit.
        within: Of each view the pixels that count, bool [H, W]; None: all.
    """
    within = [True] * len(photos) if within is None else within
    found = {}
    for palette in model.palettes:
        masks = [mask & part for mask, part in zip(truth.masks("test")[palette.name], within, strict=True)]
        if palette.name in truth.edits[name]["objects"] and np.any(masks):
            pixels = _pixels(masks, truth.masks("test")[palette.name], photos, pictures, truth.recolored(name))
            edited, added = edit.colors[palette.name], edit.added.get(palette.name, ())
            found[palette.name] = pixels.view, _steps(pixels, palette.colors, edited, added)
    found["all"] = tuple(np.concatenate(parts, axis=-1) for parts in zip(*found.values(), strict=True))
    return {key: _causes(*views_and_steps) for key, views_and_steps in found.items()}


def _pixels(
    masks: list[np.ndarray],
    objects: list[np.ndarray],
    photos: list[np.ndarray],
    ours: list[np.ndarray],
    true: list[np.ndarray],
) -> Pixels:
    """The pixels of masks, which are all of an object's masks or parts of them."""
    coverages = [gaussian_filter(mask.astype(np.float64), EDGE)[..., None] for mask in objects]
    inside = (
        np.concatenate([view[mask] for view, mask in zip(views, masks, strict=True)]).astype(np.float64)
        for views in (photos, ours, true, coverages)
    )
    return Pixels(*inside, np.repeat(np.arange(len(masks)), [mask.sum() for mask in masks]))


def _steps(pixels: Pixels, learned: np.ndarray, edited: np.ndarray, added: Sequence[AddedColor]) -> np.ndarray:
    """CIEDE2000 [5, n] of each way to recolor an object, from ours to the best function of a pixel's color."""
    weights = _weights(pixels, learned)
    finer = extract_palette(*color_cells(pixels.photo), tolerance=0, n_max=MAX_COLORS)
    best = _best(pixels, _weights(pixels, finer), finer)
    ways = (
        pixels.ours,
        pixels.photo + split_weights(weights.T, learned, added).T @ (edited - append_added_sets(learned, added)),
        _best(pixels, weights, learned),
        best,
        best + _mean_in_cells(pixels.photo, pixels.true - best),
    )
    return np.stack([pixels.difference(way) for way in ways])


def _weights(pixels: Pixels, palette: np.ndarray) -> np.ndarray:
    return pixels.coverage * palette_weights_of_image(to_bytes(pixels.photo)[None], palette)[0]


def _best(pixels: Pixels, weights: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """The pixels [n, 3] by the palette with the least CIEDE2000 to the truth.

    By least squares in sRGB, weighted anew in each round so that squared distances there become CIEDE2000; the best
    round counts.
    """
    lower, upper = bounds(palette, (), MAX_SRGB)
    found, counts = [], np.ones(len(weights))
    for _ in range(ROUNDS):
        change = bounded_least_squares(weights, pixels.true - pixels.photo, lower, upper, counts)
        found.append(np.clip(pixels.photo + weights @ change, 0, 1))
        # the floor, half a step of 8 bits, keeps pixels that are met from counting without end
        counts = pixels.difference(found[-1]) / (((found[-1] - pixels.true) ** 2).sum(1) + (0.5 / 255) ** 2)
    return min(found, key=lambda recolor: pixels.difference(recolor).mean())


def _mean_in_cells(colors: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Of each color [n, 3] the mean value [n, 3] in its cell of 32 levels a channel."""
    _, cell, counts = np.unique(cell_index(colors), return_inverse=True, return_counts=True)
    return np.stack([np.bincount(cell, channel) / counts for channel in values.T], axis=1)[cell]


def _causes(view: np.ndarray, steps: np.ndarray) -> Causes:
    means = np.mean([steps[:, view == number].mean(1) for number in np.unique(view)], axis=0)
    mask, rule, palette, weights = -np.diff(means)
    return Causes(*map(float, (*means[:3], mask, rule, palette, weights, means[-1])))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path, help="with true recolors, laid out like the demo")
    parser.add_argument("project", type=Path, help="learned of it")
    parser.add_argument("--per-paint", action="store_true", help="a color pair for each paint, not for each object")
    options = parser.parse_args()
    model, truth = karf.load(options.project), Truth(options.capture)
    frames = [model.render_view(view, "photo") for view in model.capture.split("test")]
    for name in truth.edits:
        for key, causes in split_by_cause(
            model, truth, frames, edit_to_judge(model, truth, name, options.per_paint), name
        ).items():
            print(f"{name} {key}:", *(f"{cause} {value:.2f}" for cause, value in vars(causes).items()), flush=True)


if __name__ == "__main__":
    main()
