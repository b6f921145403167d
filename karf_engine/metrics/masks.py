"""How alike two masks are; masks: bool [H, W]."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation


def iou(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union of two masks; 1 where both are empty."""
    union = np.count_nonzero(predicted | truth)
    return np.count_nonzero(predicted & truth) / union if union else 1.0


def iou_border_excluded(predicted: np.ndarray, truth: np.ndarray) -> float:
    """`iou` without the pixels that touch the truth's border (1 pixel to either side, corners included)."""
    around = np.ones((3, 3), bool)
    keep = ~(binary_dilation(truth, around) & binary_dilation(~truth, around))
    return iou(predicted & keep, truth & keep)


def accuracy(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Share of pixels, 0..1, on which two masks agree."""
    return float((predicted == truth).mean())
