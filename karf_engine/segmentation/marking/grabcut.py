"""GrabCut (Rother, Kolmogorov and Blake, 2004) by OpenCV: fit a mask to the colors inside and outside of it."""

from __future__ import annotations

import cv2
import numpy as np

# OpenCV's values of a trimap: certainly background, certainly object, probably background, probably object
NOT, SURE, PERHAPS_NOT, PERHAPS = cv2.GC_BGD, cv2.GC_FGD, cv2.GC_PR_BGD, cv2.GC_PR_FGD


def fit_colors(colors: np.ndarray, trimap: np.ndarray, iterations: int) -> np.ndarray:
    """Return the object's mask, bool [h, w]. A trimap of one side only is returned as it is.

    Args:
        colors: [h, w, 3] uint8.
        trimap: [h, w] uint8 of OpenCV's four values.
        iterations: of fitting colors and mask to each other.
    """
    is_inside = (trimap & 1).astype(bool)
    if is_inside.all() or not is_inside.any():
        return is_inside
    cv2.setRNGSeed(0)  # photos are marked before there are settings with a seed
    mask, background, foreground = trimap.copy(), np.zeros((1, 65)), np.zeros((1, 65))
    no_frame = (0, 0, 0, 0)  # ignored with GC_INIT_WITH_MASK
    cv2.grabCut(colors, mask, no_frame, background, foreground, iterations, cv2.GC_INIT_WITH_MASK)
    return (mask & 1).astype(bool)
