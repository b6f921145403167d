"""Blur estimation: many photos have more pixels than their lens resolves.

Blurring an edge of blur s again by s0 divides its gradient by R = sqrt(s^2 + s0^2) / s, so that s = s0 / sqrt(R^2 - 1)
(Zhuo and Sim, "Defocus map estimation from a single image", 2011).
"""

from __future__ import annotations

import cv2
import numpy as np

from .tiles import tiles

TILE, MARGIN = 512, 8  # pixels
SHARP = 0.9  # pixels: blur measured in renders and sharp photos
REBLUR = 1.0  # pixels: the paper's s0
EDGE_QUANTILE = 0.8  # of a tile's gradients; steeper ones are edges
MAX_SHRINK = 0.9  # photos that would shrink less stay at their size
BLUR_QUANTILE = 0.25  # of the measured blurs: edges of light and shade are soft in sharp photos too
MIN_GRADIENT = 5.0  # of 255 per pixel; below is noise
MIN_EDGES = 50


def sharp_size(photo: np.ndarray, border: np.ndarray) -> tuple[int, int]:
    """Return the largest size (rows, columns), at most its own, that a photo is sharp at along a border.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        border: bool [h, w], where edges are measured; of any smaller size.
    """
    height, width = photo.shape[:2]
    blurs = []
    for tile in tiles((height, width), TILE, MARGIN):
        near = border[_scaled(tile.rows, border.shape[0] / height), _scaled(tile.columns, border.shape[1] / width)]
        if near.any():
            blurs.append(_edge_blurs(photo[tile.outer], near))
    found = np.concatenate(blurs) if blurs else np.zeros(0)
    if len(found) < MIN_EDGES:
        return height, width
    shrink = SHARP / float(np.quantile(found, BLUR_QUANTILE))
    if shrink > MAX_SHRINK:
        return height, width
    return max(1, round(height * shrink)), max(1, round(width * shrink))


def _scaled(part: slice, factor: float) -> slice:
    return slice(int(part.start * factor), int(np.ceil(part.stop * factor)))


def _edge_blurs(photo: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the blurs of the steep edges near a border, pixels."""
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY).astype(np.float32)
    here = cv2.resize(near.astype(np.uint8), gray.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    steep, soft = _gradients(gray)[here], _gradients(cv2.GaussianBlur(gray, (0, 0), REBLUR))[here]
    edges = (steep >= np.quantile(steep, EDGE_QUANTILE)) & (steep > MIN_GRADIENT)
    ratio = np.maximum(steep[edges] / np.maximum(soft[edges], 1e-3), 1.001)
    return REBLUR / np.sqrt(ratio**2 - 1)


def _gradients(gray: np.ndarray) -> np.ndarray:
    """Return gradient magnitudes per pixel."""
    return np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)) / 8
