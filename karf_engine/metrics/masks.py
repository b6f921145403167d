"""Similarity of two masks, bool [H, W]."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation


def iou(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Return the intersection over union; 1 if both masks are empty."""
    union = np.count_nonzero(predicted | truth)
    return np.count_nonzero(predicted & truth) / union if union else 1.0


def iou_border_excluded(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Return the `iou` without the pixels on either side of the truth's border, corners included."""
    inside, outside = (binary_dilation(mask, np.ones((3, 3), bool)) for mask in (truth, ~truth))
    keep = ~np.logical_and(inside, outside)
    return iou(predicted & keep, truth & keep)


def accuracy(predicted: np.ndarray, truth: np.ndarray) -> float:
    """Return the share of pixels where two masks agree, in [0, 1]."""
    return float((predicted == truth).mean())
