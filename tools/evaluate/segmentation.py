"""Table 1: masks of the test views against the true ones."""

from __future__ import annotations

import numpy as np

from ..metrics.scores import mean_mask_scores
from .demo import MLP_HEADS, ONE, PLAIN, THREE, Demo
from .store import Store
from .table import Figures, Table
from .views import TestViews

PUBLISHED = {"MVSeg": (90.7, 98.8), "SA3D": (93.7, 99.2), "KaRF": (94.7, 99.5)}  # IoU and accuracy


def segmentation_table(store: Store) -> Table:
    """Measure our masks beside plain cross-entropy, other heads, what ships for photos, and the ceiling."""
    demo = Demo(store)
    ways = {
        "**ours**, one mask": demo.ours(),
        "ours, one mask, as shipped for photos: mattes": demo.shipped(),
        "ours, three masks": demo.learned((), THREE),
        "ours, plain MLP head": demo.learned(MLP_HEADS, ONE, "field"),
        "ours, plain MLP head of equal parameters": demo.learned(
            ("segmentation.head=mlp", "segmentation.match=parameters")
        ),
        "ours, B-spline layers": demo.learned(("segmentation.layer=bspline",)),
        "plain cross-entropy (Eq. 12), one mask": demo.learned((PLAIN,), ONE, "field"),
        "plain cross-entropy (Eq. 12), three masks": demo.learned((PLAIN,), THREE),
        "ceiling: true masks of all training views": demo.ceiling(),
    }
    truth = demo.truth.masks("test")
    rows = {label: mask_figures(test, truth) for label, test in ways.items()}
    for name, (iou, accuracy) in PUBLISHED.items():
        rows[f"paper: {name}, mean of nine other captures"] = {"iou": iou, "accuracy": accuracy}
    return Table("masks from", rows)


def mask_figures(test: TestViews, truth: dict[str, list[np.ndarray]]) -> Figures:
    """Return the figures of the test views' masks, in percent."""
    score = mean_mask_scores({name: test.masks(name) for name in test.model.objects}, truth)
    return {
        "iou": 100 * score.iou,
        "accuracy": 100 * score.accuracy,
        "iou_pooled": 100 * score.pooled,
        "iou_border": 100 * score.iou_border_excluded,
        "iou_worst": 100 * score.worst,
    }
