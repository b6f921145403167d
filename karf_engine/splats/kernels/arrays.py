"""Arrays of the kernels and their columns. Importable without numba.

Sizes: n Gaussians, K harmonics per color, T tiles, E entries of all tiles, H x W pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# columns of the table of Gaussians; from COLOR on red, green, blue of each harmonic
CENTER, LOG_SCALE, ROTATION, LOGIT, COLOR = 0, 3, 6, 10, 11
C0 = np.float32(0.28209479177387814)  # the constant harmonic
TILE = 16  # side of a tile, pixels
LANES = 8  # adjacent pixels of a row processed by vector instructions
BLOCKS = TILE // LANES
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
MIN_ALPHA, MAX_ALPHA = np.float32(1 / 255), np.float32(0.99)  # Kerbl et al.: skipped below, clamped above
DARK = np.float32(1e-4)  # tiles are finished at this transmittance
CHECK_EVERY = 32  # Gaussians of a tile between checks of its transmittance
# Largest distance of a center from the picture, in its longer sides: beyond it the linear approximation of the shape
# fails. Nothing else depends on the optical axis, so crops of a picture are equal to parts of it.
BORDER = 0.3


class ScreenFilter(NamedTuple):
    """Low-pass filter on the screen."""

    blur: np.float32  # variance added to the covariances, pixels squared
    # Opacities are scaled by the square root of the ratio of areas before and after the blur, but at least of this
    # ratio (Yu et al. 2024, "Mip-Splatting", Eq. 12); 1 turns the scaling off
    min_area_ratio: np.float32


# variance of a square pixel; the lower limit keeps the gradient finite
PIXEL_FILTER = ScreenFilter(np.float32(1 / 12), np.float32(0.005))
# of Kerbl et al. 2023, and of their program and gsplat with antialiasing
PLAIN_FILTER = ScreenFilter(np.float32(0.3), ONE)
ANTIALIASED_FILTER = ScreenFilter(np.float32(0.3), np.float32(0.000025))


class Pinhole(NamedTuple):
    """Camera with x right, y down, z forward; pixel corners are at integers."""

    rotation: np.ndarray  # [9], world to camera, row-major
    translation: np.ndarray  # [3], world to camera
    eye: np.ndarray  # [3], position in the world
    fx: np.float32
    fy: np.float32
    cx: np.float32
    cy: np.float32
    width: int
    height: int
    near: np.float32  # depth of the near plane, world units
    blur: np.float32  # of the screen filter
    least_share: np.float32


def _record(*names: str, kind: type = np.float32) -> np.dtype:
    return np.dtype((np.record, [(name, kind) for name in names]))


# Gaussian on the screen: center u v, inverse covariance [[a, b], [b, c]], filtered opacity, depth, half width and height
# of the box outside which its alpha is below MIN_ALPHA, and its color from this viewpoint
SPLAT = _record("u", "v", "a", "b", "c", "opacity", "depth", "reach_x", "reach_y", "red", "green", "blue")
# gradients of a loss with respect to these, summed over the pixels of one tile
SPLAT_GRADIENTS = _record("u", "v", "a", "b", "c", "opacity", "red", "green", "blue")
TILE_BOX = _record("left", "right", "top", "bottom", kind=np.int32)  # tiles touched by a Gaussian; ends are exclusive
ENTRY = _record("gaussian", "row", kind=np.int32)  # of a tile: its Gaussian, and the row of the gradients of this pair
