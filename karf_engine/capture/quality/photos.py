"""Measure single photos and masks: sharpness, detail, thin parts."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

FINE, COARSE = 1.0, 3.0  # Gaussian scales of the detail bands, pixels
VOXELS = 160  # approximate voxels across an image with preset `demo`
THIN = 3  # narrower parts are thin, pixels


def sharpness(picture: np.ndarray) -> float:
    """Return the ratio of fine to coarse detail of a photo, uint8 [H, W, 3]; 1 without detail.

    It falls with blur and depends little on the content.
    """
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    fine, coarse = (cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in (FINE, COARSE))
    return float(((gray - fine).std() + 1e-3) / ((fine - coarse).std() + 1e-3))


def against_neighbors(values: np.ndarray, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Divide each photo's value by the median of its paired photos, [n].

    Examples:
        >>> against_neighbors(np.array([1.0, 1.0, 0.5]), [(0, 1), (0, 2), (1, 2)]).round(2).tolist()
        [1.33, 1.33, 0.5]
    """
    neighbors: list[list[float]] = [[] for _ in values]
    for a, b in pairs:
        neighbors[a].append(values[b])
        neighbors[b].append(values[a])
    return np.array([value / np.median(others or [value]) for value, others in zip(values, neighbors, strict=True)])


def plainness(pictures: Sequence[np.ndarray]) -> float:
    """Return the PSNR in dB of photos blurred by a voxel's width against themselves: low for fine detail."""
    errors = []
    for picture in pictures:
        color = picture.astype(np.float32) / 255
        errors.append(((color - cv2.GaussianBlur(color, (0, 0), color.shape[1] / VOXELS)) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors) + 1e-6))


def thin_share(mask: np.ndarray) -> float:
    """Return the share of a mask's pixels in parts narrower than `THIN` pixels, in [0, 1].

    Examples:
        >>> mask = np.zeros((20, 20), bool)
        >>> mask[2:12, 2:12] = mask[2:12, 15] = True
        >>> round(thin_share(mask), 2)
        0.09
    """
    area = int(np.count_nonzero(mask))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((THIN, THIN), np.uint8))
    return 1 - int(np.count_nonzero(opened)) / area if area else 0.0
