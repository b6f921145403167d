"""What single photos tell: how sharp each is against those beside it, and how thin what is marked."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

FINE, COARSE = 1.0, 3.0  # pixels: the bands of detail whose ratio says how sharp a photo is
VOXELS = 160  # of a field, about, across a picture by preset `demo`
THIN = 3  # pixels: what is narrower is thin


def sharpness(picture: np.ndarray) -> float:
    """Detail of one pixel against that of three: it falls with blur, and knows little of what is shown.

    Args:
        picture: uint8 [H, W, 3].

    Returns:
        The ratio, above 0; that of a picture without detail is 1.
    """
    gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float32)
    fine, coarse = (cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in (FINE, COARSE))
    return float(((gray - fine).std() + 1e-3) / ((fine - coarse).std() + 1e-3))


def against_neighbors(values: np.ndarray, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """Each photo's value over the median of those that it is paired with, [n].

    Examples:
        >>> against_neighbors(np.array([1.0, 1.0, 0.5]), [(0, 1), (0, 2), (1, 2)]).round(2).tolist()
        [1.33, 1.33, 0.5]
    """
    beside: list[list[float]] = [[] for _ in values]
    for a, b in pairs:
        beside[a].append(values[b])
        beside[b].append(values[a])
    return np.array([value / np.median(others or [value]) for value, others in zip(values, beside, strict=True)])


def plainness(pictures: Sequence[np.ndarray]) -> float:
    """PSNR of all photos against themselves blurred by one voxel's width, dB: low where they are full of fine detail."""
    errors = []
    for picture in pictures:
        color = picture.astype(np.float32) / 255
        errors.append(((color - cv2.GaussianBlur(color, (0, 0), color.shape[1] / VOXELS)) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors) + 1e-6))


def thin_share(mask: np.ndarray) -> float:
    """Share of a mask's pixels that lie where it is narrower than `THIN` pixels, in [0, 1].

    Examples:
        >>> mask = np.zeros((20, 20), bool)
        >>> mask[2:12, 2:12] = mask[2:12, 15] = True
        >>> round(thin_share(mask), 2)
        0.09
    """
    area = int(np.count_nonzero(mask))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((THIN, THIN), np.uint8))
    return 1 - int(np.count_nonzero(opened)) / area if area else 0.0
