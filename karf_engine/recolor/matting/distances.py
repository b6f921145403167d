"""Euclidean distance transform."""

from __future__ import annotations

import cv2
import numpy as np


def distance_to(mask: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel to a mask, bool [h, w]: float32, 0 inside; infinite for an empty mask.

    Examples:
        >>> distance_to(np.array([[True, False, False]])).tolist()
        [[0.0, 1.0, 2.0]]
    """
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
