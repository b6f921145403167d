"""What coarse masks say about surface points.

A labelled view holds masks of some of the objects. A pixel in a mask votes for that object. A pixel outside all of them
votes evenly for the background and for the objects that have no mask in this view: it may well be one of those.
Confidence grows from 0 at a mask's border, where hands are least exact, to 1 a few pixels away.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

BAND_PIXELS = 6.0  # at 200 pixels of height
BAND_OF_RADIUS = 0.35


def mask_targets(masks: dict[int, np.ndarray], n_classes: int) -> np.ndarray:
    """Class votes [H, W, n_classes] of one view's masks {class number: bool [H, W]}; rows sum to 1.

    Where masks overlap they share the pixel.
    """
    height, width = next(iter(masks.values())).shape
    targets = np.zeros((height, width, n_classes))
    for number, mask in masks.items():
        targets[mask, number] = 1
    unmarked = [k for k in range(n_classes) if k not in masks]
    outside = targets.sum(2) == 0
    targets[np.ix_(np.arange(height), np.arange(width), unmarked)] += outside[..., None]
    return targets / targets.sum(2, keepdims=True)


def mask_confidence(masks: dict[int, np.ndarray]) -> np.ndarray:
    """How far each pixel lies from the masks' borders, [H, W] in [0, 1]."""
    height, width = next(iter(masks.values())).shape
    confidence = np.ones((height, width))
    for mask in masks.values():
        if not mask.any() or mask.all():
            continue
        distance = np.where(mask, distance_transform_edt(mask), distance_transform_edt(~mask))
        band = min(BAND_PIXELS * height / 200, BAND_OF_RADIUS * np.sqrt(mask.sum() / np.pi))
        confidence = np.minimum(confidence, distance / max(band, 1.0))
    return np.minimum(confidence, 1.0)


def vote_on_points(
    point_of_sample: np.ndarray, targets: np.ndarray, confidence: np.ndarray, n_points: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the votes of rays on the points their samples belong to.

    point_of_sample: [n, K]; targets: [n, C]; confidence: [n]. Returns targets [p, C], whose rows sum to 1, and
    confidence [p]; a point without votes has confidence 0 and an even target.
    """
    n_samples = point_of_sample.shape[1]
    point = point_of_sample.ravel()
    weight = np.repeat(confidence / n_samples, n_samples)
    total = np.bincount(point, weight, n_points)
    votes = np.stack([np.bincount(point, weight * np.repeat(column, n_samples), n_points) for column in targets.T], 1)
    even = 1.0 / targets.shape[1]
    return np.where(total[:, None] > 0, votes / np.maximum(total, 1e-12)[:, None], even), total
