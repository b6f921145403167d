"""Noise estimation and denoising of photos.

An edit adds weights x change to a photo. Weights of noisy colors would amplify the noise; weights of the denoised photo
leave it as it is.
"""

from __future__ import annotations

import cv2
import numpy as np

RADIUS = 3  # pixels, of the bilateral filter
SIGMA_COLOR = 4.0  # of the bilateral filter, standard deviations of the noise
MIN_GRAIN = 0.3  # 1/255: the rounding of 8 bits


def estimate_noise(photo: np.ndarray) -> float:
    """Estimate the standard deviation of a photo's noise per channel, 1/255.

    Robust median estimator on the diagonal details of the Haar wavelet (Donoho and Johnstone 1994, "Ideal spatial
    adaptation by wavelet shrinkage").

    Args:
        photo: [H, W, 3] uint8, or float from 0 to 255.

    Examples:
        >>> flat = np.full((200, 200, 3), 100.0)
        >>> grainy = flat + np.random.default_rng(0).normal(0, 2, flat.shape)
        >>> estimate_noise(flat), round(estimate_noise(grainy), 1)
        (0.0, 2.0)
    """
    height, width = (side // 2 * 2 for side in photo.shape[:2])
    if not height or not width:
        return 0.0
    blocks = photo[:height, :width].astype(np.float32).reshape(height // 2, 2, width // 2, 2, 3)
    details = (blocks[:, 0, :, 0] - blocks[:, 0, :, 1] - blocks[:, 1, :, 0] + blocks[:, 1, :, 1]) / 2
    return float(np.median(np.abs(details), axis=(0, 1)).mean() / 0.6745)


def denoise(photo: np.ndarray, grain: float) -> np.ndarray:
    """Denoise a photo with a bilateral filter (Tomasi and Manduchi 1998); return its type and size.

    Args:
        photo: [H, W, 3] uint8, or float32 from 0 to 255.
        grain: Its `estimate_noise`; below the rounding of 8 bits the photo itself is returned.

    Examples:
        >>> edge = np.repeat(np.array([[[50.0] * 3, [200.0] * 3]], np.float32), 20, axis=1).repeat(40, axis=0)
        >>> grainy = edge + np.random.default_rng(0).normal(0, 2, edge.shape).astype(np.float32)
        >>> calm = denoise(grainy, 2.0)
        >>> bool((calm - edge).std() < 1), bool(np.abs(calm - edge).max() < 5)
        (True, True)
    """
    if grain < MIN_GRAIN:
        return photo
    return cv2.bilateralFilter(np.ascontiguousarray(photo), 2 * RADIUS + 1, SIGMA_COLOR * grain, RADIUS)
