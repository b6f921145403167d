"""GrabCut (Rother, Kolmogorov and Blake, 2004) by OpenCV: a mask that fits the colors inside and outside of it."""

from __future__ import annotations

import cv2
import numpy as np

# how OpenCV numbers what is known: certainly not the object, certainly the object, perhaps
NOT, SURE, PERHAPS_NOT, PERHAPS = 0, 1, 2, 3


def fit_colors(colors: np.ndarray, trimap: np.ndarray, iterations: int) -> np.ndarray:
    """The object's mask.

    Args:
        colors: [h, w, 3] uint8.
        trimap: [h, w] uint8 of the four numbers above.
        iterations: How often colors and mask are fitted to each other.

    Returns:
        bool [h, w]; where the trimap has only one side, that side.
    """
    is_inside = (trimap & 1).astype(bool)
    if is_inside.all() or not is_inside.any():
        return is_inside
    cv2.setRNGSeed(0)  # photos are marked before there are settings with a seed
    found, unused = trimap.copy(), np.zeros((1, 65))
    cv2.grabCut(colors, found, None, unused, unused.copy(), iterations, cv2.GC_INIT_WITH_MASK)
    return (found & 1).astype(bool)
