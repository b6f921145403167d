"""Predict the PSNR of held-out views with preset `demo` by linear regression over captures with known results.

The coefficients were fitted to 25 captures of 12 scenes by `tools/scenes/inspections.py`; docs/benchmark.md has their
accuracy on other scenes. All are in dB.
"""

from __future__ import annotations

import math

INTERCEPT = 13.8
OF_AGREED = 24.5  # coefficient of the share of matches that agree with the cameras
OF_MATTE = 5.6  # coefficient of a matte
MOST_ABOVE_PLAINNESS = 4.0  # detail finer than voxels is not learned
RMS_ERROR = 2.8  # in leave-one-scene-out cross-validation
OF_SPACING = -6.3  # for each doubling of the angle to the nearest photo
NEAR_ANGLE = 4.0  # degrees; nearer photos gain nothing


def predict_psnr(agreed: float, plainness: float, is_matte: bool) -> float:
    """Predict the PSNR of held-out views, dB, from the figures of an `Inspection`.

    Examples:
        >>> predict_psnr(0.8, 32.0, False), predict_psnr(0.8, 25.0, False)
        (33.4, 29.0)
    """
    on_line = INTERCEPT + OF_AGREED * agreed + OF_MATTE * is_matte
    return round(min(on_line, plainness + MOST_ABOVE_PLAINNESS), 3)


def psnr_gain(spacing: float, new_spacing: float) -> float:
    """Predict the gain of more photos, dB, from the angle to the nearest photo in degrees, before and after.

    Examples:
        >>> psnr_gain(16.0, 8.0), psnr_gain(3.0, 2.0)
        (6.3, 0.0)
    """
    return OF_SPACING * math.log2(max(new_spacing, NEAR_ANGLE) / max(spacing, NEAR_ANGLE)) + 0.0
