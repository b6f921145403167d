"""Grain of photos: how strong it is, and what they show without it.

An edit adds weights x change to a photo. Weights that are taken from the grain as well make grain of their own, and a dark
paint that becomes a bright one as much more of it as the paint is brighter. Weights of the photo without its grain make
none: the edited photo has the grain that it was taken with.
"""

from __future__ import annotations

import cv2
import numpy as np

RADIUS = 3  # pixels of the window in which alike neighbors are averaged
ALIKE = 4.0  # difference in deviations of the grain at which a neighbor counts little
LEAST = 0.3  # 1/255: the rounding of 8 bits


def grain_of(photo: np.ndarray) -> float:
    """The standard deviation of a photo's grain in each channel, 1/255 of its range, by the median of its finest details.

    Donoho and Johnstone (1994), "Ideal spatial adaptation by wavelet shrinkage": diagonal details of the Haar wavelet,
    of which most pixels show nothing but noise.

    Args:
        photo: [H, W, 3] uint8, or float from 0 to 255.

    Examples:
        >>> flat = np.full((200, 200, 3), 100.0)
        >>> grainy = flat + np.random.default_rng(0).normal(0, 2, flat.shape)
        >>> grain_of(flat), round(grain_of(grainy), 1)
        (0.0, 2.0)
    """
    height, width = (side // 2 * 2 for side in photo.shape[:2])
    if not height or not width:
        return 0.0
    blocks = photo[:height, :width].astype(np.float32).reshape(height // 2, 2, width // 2, 2, 3)
    details = (blocks[:, 0, :, 0] - blocks[:, 0, :, 1] - blocks[:, 1, :, 0] + blocks[:, 1, :, 1]) / 2
    return float(np.median(np.abs(details), axis=(0, 1)).mean() / 0.6745)


def without_grain(photo: np.ndarray, grain: float) -> np.ndarray:
    """A photo whose pixels are averaged with alike neighbors (bilateral filter; Tomasi and Manduchi 1998).

    Args:
        photo: [H, W, 3] uint8, or float32 from 0 to 255.
        grain: Its `grain_of`; under the rounding of 8 bits the photo stays as it is.

    Returns:
        Of the photo's type and size.

    Examples:
        >>> edge = np.repeat(np.array([[[50.0] * 3, [200.0] * 3]], np.float32), 20, axis=1).repeat(40, axis=0)
        >>> grainy = edge + np.random.default_rng(0).normal(0, 2, edge.shape).astype(np.float32)
        >>> calm = without_grain(grainy, 2.0)
        >>> bool((calm - edge).std() < 1), bool(np.abs(calm - edge).max() < 5)
        (True, True)
    """
    if grain < LEAST:
        return photo
    return cv2.bilateralFilter(np.ascontiguousarray(photo), 2 * RADIUS + 1, ALIKE * grain, RADIUS)
