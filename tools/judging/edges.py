"""How near the edges of mattes come to the truth, at the photo's own size.

Naming: coverage [H, W] in [0, 1], the share of each pixel that shows the object; a mask is coverage over one half.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from karf_engine.metrics.images import mean_ciede2000
from karf_engine.metrics.masks import iou
from tools.metrics.scores import MIN_PIXELS

BAND = 3  # pixels on either side of the true border
THIN = 1 / 64  # of the photo's width: half of what is the width of thin parts at most
NEAR = 1  # half widths around a thin part within which a false claim counts against it


@dataclass(frozen=True)
class EdgeScore:
    """One object in one view, NaN where the view has nothing to judge.

    Attributes:
        iou: Of the masks.
        iou_thin: Of the masks, in and beside the object's thin parts.
        band_error: Mean absolute error of the coverage within `BAND` pixels of the true border.
        ciede2000: Mean over edits of the mean color difference to the true recolor, in the true mask.
        ciede2000_band: The same within `BAND` pixels of the true border.
    """

    iou: float
    iou_thin: float
    band_error: float
    ciede2000: float
    ciede2000_band: float


def score_edges(
    coverage: np.ndarray, truth: np.ndarray, recolored: list[np.ndarray], true_recolors: list[np.ndarray]
) -> EdgeScore:
    """Judge an object's coverage, and pictures [H, W, 3] of the edits that change it, float sRGB in [0, 1]."""
    mask = truth > 0.5
    if mask.sum() < MIN_PIXELS:
        return EdgeScore(*[float("nan")] * 5)
    band, thin = border_band(mask), beside_thin_parts(mask)
    pairs = list(zip(recolored, true_recolors, strict=True))
    return EdgeScore(
        iou=iou(coverage > 0.5, mask),
        iou_thin=iou((coverage > 0.5) & thin, mask & thin) if (mask & thin).sum() >= MIN_PIXELS else float("nan"),
        band_error=float(np.abs(coverage - truth)[band].mean()),
        ciede2000=float(np.mean([mean_ciede2000(ours, true, mask) for ours, true in pairs])),
        ciede2000_band=float(np.mean([mean_ciede2000(ours, true, band) for ours, true in pairs])),
    )


def mean_scores(scores: list[EdgeScore]) -> dict[str, float]:
    """Means over the views in which there was something to judge; no entry where there was none."""
    columns = {key: [getattr(score, key) for score in scores] for key in EdgeScore.__dataclass_fields__}
    return {key: float(np.nanmean(values)) for key, values in columns.items() if np.isfinite(values).any()}


def border_band(mask: np.ndarray) -> np.ndarray:
    """Pixels within `BAND` of the mask's border, on either side."""
    return (distance(mask) <= BAND) & (distance(~mask) <= BAND)


def beside_thin_parts(mask: np.ndarray) -> np.ndarray:
    """Thin parts of a mask, and what lies beside them and beside no thick part.

    Thin is what a disk of `THIN` does not fit into; corners and rims of thick parts, where it does not fit either, are
    no thin parts.
    """
    radius = max(1.0, THIN * mask.shape[1])
    core = distance(mask) > radius
    thick = distance(~core) <= radius
    away = distance(~thick) > radius / 2
    return away & (distance(~(mask & away)) <= NEAR * radius)


def distance(inside: np.ndarray) -> np.ndarray:
    """Pixels from each center to the nearest one outside; infinite where there is none."""
    if inside.all():
        return np.full(inside.shape, np.inf, np.float32)
    return cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
