"""How near edits of a learned scene come to its true recolors; used by the demo and by the drawn scenes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np
from skimage.color import rgb2lab

from karf_engine.errors import BadRequest
from karf_engine.metrics.images import hue_shift
from karf_engine.palettes.calibration import to_mean_exposure
from karf_engine.palettes.palette import Edit
from karf_engine.palettes.project_edit import solve
from karf_engine.recolor.model import Model

from ..metrics.scores import hue_shifted, score_recolor
from ..metrics.truth import Truth
from .table import Figures
from .views import TestViews

Pictures = Mapping[str, list[np.ndarray]]  # of each edit, the test views [H, W, 3]


def edit_to_judge(model: Model, truth: Truth, name: str, per_paint: bool = False) -> Edit:
    """Return an edit told by one color pair for each object, or for each of its paints, read in the reference view.

    What is read there is meant in the photos' mean exposure.
    """
    palettes = {palette.name: palette for palette in model.palettes}
    colors = {key: palette.colors for key, palette in palettes.items()}
    reference = truth.edits[name]["reference_view"]
    (gains,) = (view.gains for view in model.capture.split("train") if view.stem == reference)
    for key in truth.edits[name]["objects"]:
        pairs = truth.paint_pairs(name, key) if per_paint else [truth.color_pair(name, key)]
        sources_and_targets = (to_mean_exposure(np.stack(each), gains) for each in zip(*pairs, strict=True))
        with suppress(BadRequest):  # paint that the reading shows black cannot be told: it stays
            colors[key] = solve(model.project, palettes[key], *sources_and_targets, "becomes")
    return Edit(colors, "delta")


def recolored(views: TestViews, truth: Truth, per_paint: bool) -> Pictures:
    """Return the views with each edit, told by a color pair for each paint or for each object."""
    edits = {name: edit_to_judge(views.model, truth, name, per_paint) for name in truth.edits}
    return {name: [views.model.composite(frame, edit) for frame in views.frames] for name, edit in edits.items()}


def ciede2000_of(pictures: Pictures, truth: Truth) -> float:
    """Return the mean CIEDE2000 to the true recolors, inside the edited objects."""
    return _mean(pictures, pictures, truth, "ciede2000")


def outside_of(pictures: Pictures, photos: list[np.ndarray], truth: Truth) -> float:
    """Return the mean squared error to the photos, outside the edited objects."""
    return _mean(pictures, dict.fromkeys(truth.edits, photos), truth, "mse_outside")


def _mean(pictures: Pictures, photos: Pictures, truth: Truth, name: str) -> float:
    scores = [
        score_recolor(views, truth.recolored(edit), photos[edit], truth.inside(edit))
        for edit, views in pictures.items()
    ]
    return float(np.mean([getattr(score, name) for score in scores]))


def baselines(photos: list[np.ndarray], truth: Truth) -> Figures:
    """Return the figures of no edit, and of hue shifts in the true masks by the pairs that ours is told."""
    by_paint, by_object = {}, {}
    for edit, entry in truth.edits.items():
        masks = [{name: labels == truth.names[name] for name in entry["objects"]} for labels in truth.labels("test")]
        paints = {name: truth.paint_pairs(edit, name) for name in entry["objects"]}
        pairs = {name: truth.color_pair(edit, name) for name in entry["objects"]}
        by_paint[edit] = [hue_shift_of_paints(p, own, paints) for p, own in zip(photos, masks, strict=True)]
        by_object[edit] = [hue_shifted(photo, own, pairs) for photo, own in zip(photos, masks, strict=True)]
    return {
        "ciede2000_hue_per_paint": ciede2000_of(by_paint, truth),
        "ciede2000_hue": ciede2000_of(by_object, truth),
        "ciede2000_no_edit": ciede2000_of(dict.fromkeys(truth.edits, photos), truth),
    }


def hue_shift_of_paints(
    photo: np.ndarray, masks: dict[str, np.ndarray], paints: dict[str, list[tuple[np.ndarray, np.ndarray]]]
) -> np.ndarray:
    """Return the photo with the hue of each masked pixel shifted by the color pair whose source is nearest to it in CIELAB.

    Args:
        photo: sRGB [H, W, 3] in [0, 1].
        masks: bool [H, W] of each object.
        paints: source and target [3], sRGB, of each paint of each object.
    """
    result = photo.copy()
    for name, mask in masks.items():
        own, sources = photo[mask], rgb2lab(np.stack([source for source, _ in paints[name]]))
        nearest = np.linalg.norm(rgb2lab(own)[:, None] - sources, axis=2).argmin(1)
        shifted = np.stack([hue_shift(own, *pair) for pair in paints[name]])
        result[mask] = shifted[nearest, np.arange(len(own))]
    return result
