"""Palettes and edits have the exposure that photos have in the mean: their colors as one photo shows them, and back.

A photo's gains of red, green and blue are factors of sRGB (`capture.View.gains`), and so a palette, its change and a picture
are multiplied alike. Numpy alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..capture.capture import ALIKE


def as_exposed(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Colors of the mean exposure, or changes of them, as a photo of these gains shows them; with gains of 1 the same bits.

    Args:
        colors: sRGB float32 [..., 3].
        gains: Of the photo.

    Returns:
        float32 [..., 3], not clipped.

    Examples:
        >>> as_exposed(np.array([0.5, 0.5, 0.5], np.float32), (1.25, 1.0, 0.5)).tolist()
        [0.625, 0.5, 0.25]
    """
    return np.asarray(colors, np.float32) * np.float32(gains)


def exposed_alike(colors: np.ndarray, gains: Sequence[float]) -> np.ndarray:
    """Colors of a photo as they are in the mean exposure; with gains of 1 the array itself.

    Args:
        colors: sRGB [..., 3] in [0, 1], or uint8.
        gains: Of the photo.

    Returns:
        float32 [..., 3] in [0, 1]: what is clipped stays so.

    Examples:
        >>> exposed_alike(np.array([[255, 102, 51]], np.uint8), (0.5, 1.0, 2.0)).round(3).tolist()
        [[1.0, 0.4000000059604645, 0.10000000149011612]]
    """
    if tuple(gains) == ALIKE:
        return colors
    values = np.asarray(colors, np.float32) / (255 if np.asarray(colors).dtype == np.uint8 else 1)
    return np.clip(values / np.float32(gains), 0, 1).astype(np.float32)
