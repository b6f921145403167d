"""How well Gaussians show photos."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .fit import Photo
from .gaussians import Gaussians
from .rasterizer import splatted


def psnr(gaussians: Gaussians, photos: Sequence[Photo]) -> float:
    """Peak signal-to-noise ratio in dB for peak 1, of the mean over photos; at most 100."""
    return -10 * float(np.log10(np.mean([_squared_error(gaussians, photo) for photo in photos]) + 1e-10))


def _squared_error(gaussians: Gaussians, photo: Photo) -> float:
    squares = np.square(splatted(gaussians, photo.camera).picture() - photo.over(gaussians.background))
    return float((squares if photo.valid is None else squares[photo.valid]).mean())
