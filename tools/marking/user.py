"""A simulated user, as interactive segmentation is measured by (Xu et al., "Deep Interactive Object Selection", 2016).

The first click lies in the middle of the largest part of the object, each next one in the middle of the largest error.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import cv2
import numpy as np

from karf_engine.metrics.masks import iou
from karf_engine.segmentation.marking.prompts import Prompts
from karf_engine.segmentation.marking.proposals import Marker

ENOUGH = 0.85  # IoU
MOST_CLICKS = 20
SHOWN = (1, 3, 5)  # IoU is told after so many clicks, which are made in any case


@dataclass(frozen=True)
class Marking:
    """How one object in one photo was marked.

    Attributes:
        ious: After 0, 1, 2 .. clicks; 0 clicks are the box alone, or nothing.
        clicks: How many it took to `ENOUGH`, at most `MOST_CLICKS`.
        seconds: Processor seconds an answer took, in the mean.
        disobeyed: Clicks that a mask went against.
    """

    ious: tuple[float, ...]
    clicks: int
    seconds: float
    disobeyed: int

    def after(self, count: int) -> float:
        """IoU after so many clicks; a user stops when nothing is wrong."""
        return self.ious[min(count, len(self.ious) - 1)]


def mark(photo: np.ndarray, truth: np.ndarray, from_box: bool) -> Marking:
    """Mark an object.

    Args:
        photo: Float sRGB [H, W, 3 or 4].
        truth: bool [H, W], not empty.
        from_box: Whether the user draws the object's frame first.
    """
    marker, mask, ious, disobeyed = Marker(photo), np.zeros_like(truth), [0.0], 0
    prompts = Prompts(box=_frame(truth) if from_box else None)
    start, asked = time.process_time(), 0
    if from_box:
        mask, asked = marker.propose(prompts), 1
        ious = [iou(mask, truth)]
    while (click := next_click(mask, truth)) and not _is_done(ious):
        prompts = replace(prompts, points=(*prompts.points, click))
        mask, asked = marker.propose(prompts), asked + 1
        ious.append(iou(mask, truth))
        disobeyed += sum(mask[int(y), int(x)] != is_object for x, y, is_object in prompts.points)
    seconds = (time.process_time() - start) / asked
    reached = next((count for count, value in enumerate(ious) if value >= ENOUGH), MOST_CLICKS)
    return Marking(tuple(ious), reached, seconds, disobeyed)


def _is_done(ious: list[float]) -> bool:
    clicks = len(ious) - 1
    return clicks >= MOST_CLICKS or (clicks >= max(SHOWN) and max(ious) >= ENOUGH)


def next_click(mask: np.ndarray, truth: np.ndarray) -> tuple[float, float, bool] | None:
    """The middle of the largest connected error; None where there is none."""
    largest: tuple[int, np.ndarray, bool] | None = None
    for wrong, is_object in ((truth & ~mask, True), (mask & ~truth, False)):
        _, parts, figures, _ = cv2.connectedComponentsWithStats(wrong.astype(np.uint8), connectivity=8)
        if len(figures) > 1:
            number = 1 + int(figures[1:, cv2.CC_STAT_AREA].argmax())
            area = int(figures[number, cv2.CC_STAT_AREA])
            if largest is None or area > largest[0]:
                largest = area, parts == number, is_object
    if largest is None:
        return None
    _, part, is_object = largest
    depth = cv2.distanceTransform(np.pad(part, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(depth.argmax(), depth.shape)
    return float(column) + 0.5, float(row) + 0.5, is_object


def _frame(truth: np.ndarray) -> tuple[float, float, float, float]:
    rows, columns = np.nonzero(truth)
    return float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1)
