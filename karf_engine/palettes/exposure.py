"""Convert colors between the mean exposure, that of palettes and edits, and the exposure of one photo.

A photo's gains of red, green and blue are factors of sRGB (`capture.View.gains`), so colors and changes of colors
scale alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..capture.capture import UNIT_GAINS


def to_photo_exposure(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Convert colors, or changes of colors, from the mean exposure to that of a photo with these gains.

    Returns float32 [..., 3], not clipped; gains of 1 keep the bits.

    Examples:
        >>> to_photo_exposure(np.array([0.5, 0.5, 0.5], np.float32), (1.25, 1.0, 0.5)).tolist()
        [0.625, 0.5, 0.25]
    """
    return np.asarray(colors, np.float32) * np.asarray(gains, np.float32)


def to_mean_exposure(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Convert colors of a photo with these gains, sRGB in [0, 1] or uint8, to the mean exposure.

    Returns float32 [..., 3] in [0, 1]; gains of 1 return the array itself. Clipped values stay clipped.

    Examples:
        >>> to_mean_exposure(np.array([[255, 102, 51]], np.uint8), (0.5, 1.0, 2.0)).round(3).tolist()
        [[1.0, 0.4000000059604645, 0.10000000149011612]]
    """
    if tuple(gains) == UNIT_GAINS:
        return colors
    values = np.asarray(colors, np.float32) / (255 if np.asarray(colors).dtype == np.uint8 else 1)
    return np.clip(values / np.asarray(gains, np.float32), 0, 1).astype(np.float32)
