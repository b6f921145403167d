"""How sharp a photo is where it matters: many photos are larger than what their lens resolves.

An edge that a Gaussian of deviation s blurs, blurred again by s0, loses a share of its steepness that tells s: the
ratio of the gradients is sqrt(s^2 + s0^2) / s (Zhuo and Sim, "Defocus map estimation from a single image", 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from .tiles import tiles

TILE, MARGIN = 512, 8


@dataclass(frozen=True)
class SharpnessParameters:
    """What tells how sharp a photo is.

    Attributes:
        sharp: Deviation that is measured in renders and in photos that are sharp to the pixel, pixels.
        blur_again: The paper's s0, pixels. Not varied on record.
        steepest: Only gradients above this quantile of a tile's are edges. Not varied on record.
        nearly: A photo that is as sharp as one smaller by this factor stays as it is. Not varied on record.
        typical: Quantile of the deviations: edges of light and shade are soft in sharp photos too. Not varied on record.
        least_steep: Gradients of 255 a pixel below which there is only noise; lowered from 8 for soft edges of low
            contrast, with drawn disks.
        fewest: Edges that tell. Not varied on record.
    """

    sharp: float = 0.9
    blur_again: float = 1.0
    steepest: float = 0.8
    nearly: float = 0.9
    typical: float = 0.25
    least_steep: float = 5.0
    fewest: int = 50


PARAMETERS = SharpnessParameters()


def sharp_size(photo: np.ndarray, border: np.ndarray) -> tuple[int, int]:
    """The size (rows, columns) at which a photo would be sharp to the pixel along a border, at most its own.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        border: bool [h, w], where the edges are that count; of any smaller size.
    """
    height, width = photo.shape[:2]
    deviations = []
    for tile in tiles((height, width), TILE, MARGIN):
        near = border[_scaled(tile.rows, border.shape[0] / height), _scaled(tile.columns, border.shape[1] / width)]
        if near.any():
            deviations.append(_deviations(photo[tile.outer], near))
    found = np.concatenate(deviations) if deviations else np.zeros(0)
    if len(found) < PARAMETERS.fewest:
        return height, width
    shrink = PARAMETERS.sharp / float(np.quantile(found, PARAMETERS.typical))
    if shrink > PARAMETERS.nearly:
        return height, width
    return max(1, round(height * shrink)), max(1, round(width * shrink))


def _scaled(part: slice, factor: float) -> slice:
    return slice(int(part.start * factor), int(np.ceil(part.stop * factor)))


def _deviations(photo: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Deviations of the steep edges near a border, pixels of the photo."""
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY).astype(np.float32)
    here = cv2.resize(near.astype(np.uint8), gray.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    steep, soft = _steepness(gray)[here], _steepness(cv2.GaussianBlur(gray, (0, 0), PARAMETERS.blur_again))[here]
    edges = (steep >= np.quantile(steep, PARAMETERS.steepest)) & (steep > PARAMETERS.least_steep)
    ratio = np.maximum(steep[edges] / np.maximum(soft[edges], 1e-3), 1.001)
    return PARAMETERS.blur_again / np.sqrt(ratio**2 - 1)


def _steepness(gray: np.ndarray) -> np.ndarray:
    """Length of the gradient, per pixel."""
    return np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)) / 8
