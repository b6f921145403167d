"""How sharp a rendered view is: the blur that would make its photo as different from itself as the rendering is."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

BLURS = np.geomspace(0.3, 20, 24)  # standard deviations, pixels
SHARP, SOFT = 1.0, 3.0  # greatest blurs of these words, pixels


def blur_of(shown: np.ndarray, photo: np.ndarray, valid: np.ndarray | None = None) -> float:
    """Return the blur of a rendered view [H, W, 3] in pixels, at least 0.3 and at most 20; photo: sRGB [H, W, 3].

    valid: [H, W] bool, the pixels that count. The view is judged in the photo's exposure.
    """
    counted = np.ones(photo.shape[:2], bool) if valid is None else valid
    own, target = shown[counted], photo[counted]
    gains = (own * target).sum(0) / np.maximum(np.square(own).sum(0), 1e-9)
    error = np.square(gains * own - target).mean()
    errors = [np.square(gaussian_filter(photo, (blur, blur, 0)) - photo)[counted].mean() for blur in BLURS]
    return float(np.interp(error, errors, BLURS))


def word_for(blur: float) -> str:
    """Return `sharp`, `soft` or `poor` for a blur in pixels."""
    return "sharp" if blur <= SHARP else "soft" if blur <= SOFT else "poor"
