"""Changes of single pixels in the true masks: what one does with a picture editor and a perfect selection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from karf_engine.io.color import linear_to_srgb, srgb_to_linear

LEAST = 1e-3  # of a source's channel, linear light: a gain divides by it


def channel_gains(
    photo: np.ndarray, masks: Mapping[str, np.ndarray], pairs: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """The photo with each object's channels scaled so that the source becomes the target, in linear light.

    The diagonal color transfer; of Reinhard et al. (2001), "Color transfer between images", it is what a single pair
    determines, which has a mean and no deviation.

    Args:
        photo: sRGB [H, W, 3] in [0, 1].
        masks: bool [H, W] of each object.
        pairs: Source and target [3] of each, sRGB.

    Example:
        >>> photo, half = np.full((1, 2, 3), 0.5), np.array([[True, False]])
        >>> channel_gains(photo, {"pot": half}, {"pot": (np.full(3, 0.5), np.array([1.0, 0.5, 0.0]))}).round(2).tolist()
        [[[1.0, 0.5, 0.0], [0.5, 0.5, 0.5]]]
    """
    result = photo.astype(np.float64)
    for name, mask in masks.items():
        source, target = (srgb_to_linear(color) for color in pairs[name])
        gain = target / np.maximum(source, LEAST)
        result[mask] = linear_to_srgb(np.clip(srgb_to_linear(photo[mask]) * gain, 0, 1))
    return result
