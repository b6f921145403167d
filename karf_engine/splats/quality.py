"""PSNR of Gaussians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .fit import Photo
from .gaussians import Gaussians
from .rasterizer import rasterize


def psnr(gaussians: Gaussians, photos: Sequence[Photo], gains: np.ndarray | float = 1.0) -> float:
    """Return the PSNR in dB, at most 100, of the mean squared error over photos.

    Args:
        gaussians: Scene.
        photos: Photos, rendered from their own cameras.
        gains: Exposure of the photos relative to the scene, [3] sRGB (see exposures.py).
    """
    return -10 * float(np.log10(np.mean([_squared_error(gaussians, photo, gains) for photo in photos]) + 1e-10))


def _squared_error(gaussians: Gaussians, photo: Photo, gains: np.ndarray | float) -> float:
    shown = (np.float32(gains) * rasterize(gaussians, photo.camera).image[..., :3]).clip(0, 1)
    squares = np.square(shown - photo.over(gaussians.background))
    return float((squares if photo.valid is None else squares[photo.valid]).mean())
