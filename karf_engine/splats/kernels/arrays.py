"""The arrays that kernels share, and what their columns are. Without numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# columns of the table of Gaussians; behind COLOR three for each harmonic: red, green, blue
CENTER, LOG_SCALE, ROTATION, LOGIT, COLOR = 0, 3, 6, 10, 11
C0 = np.float32(0.28209479177387814)  # the first harmonic, the same from everywhere
TILE = 16  # pixels of a tile's side
LANES = 8  # neighboring pixels of a row that are computed at once
BLOCKS = TILE // LANES
ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
LEAST_ALPHA, MOST_ALPHA = np.float32(1 / 255), np.float32(0.99)  # Kerbl et al.: less is left out, more cut off
DARK = np.float32(1e-4)  # transmittance behind which nothing is seen
LOOK_EVERY = 32  # Gaussians of a tile between two looks at whether it has become dark
# of the picture's larger side, beyond which a center's Gaussian is left out: its shape on the screen is a linear
# guess. Bands and windows of a picture show what it shows, so nothing else depends on where the axis is
BORDER = 0.3


class ScreenFilter(NamedTuple):
    """What is done to Gaussians on the screen so that none is finer than a pixel.

    Attributes:
        blur: Added to their covariances, pixels squared.
        least_share: Their opacities fall by as much as their areas grow (Yu et al. 2024, "Mip-Splatting", Eq. 12), to no
            less than this share's square root. 1: they stay.
    """

    blur: np.float32
    least_share: np.float32


# our own: the variance of a pixel's square; the least share keeps the opacity's slope finite
PIXEL_FILTER = ScreenFilter(np.float32(1 / 12), np.float32(0.005))
# of Kerbl et al. 2023, and of what their program and gsplat learn where they are asked for antialiasing
PLAIN_FILTER = ScreenFilter(np.float32(0.3), ONE)
ANTIALIASED_FILTER = ScreenFilter(np.float32(0.3), np.float32(0.000025))


class Pinhole(NamedTuple):
    """A camera as kernels read it: x right, y down, z forward; pixel corners at integers.

    Attributes:
        turn: [9], rotation from world to camera, row by row.
        shift: [3], its translation.
        eye: [3], the camera's place in the world.
        fx, fy, cx, cy: Pixels.
        width, height: Pixels.
        near: What is nearer, along the axis, is not seen; world units.
        blur, least_share: Of the screen filter.
    """

    turn: np.ndarray
    shift: np.ndarray
    eye: np.ndarray
    fx: np.float32
    fy: np.float32
    cx: np.float32
    cy: np.float32
    width: int
    height: int
    near: np.float32
    blur: np.float32
    least_share: np.float32


def _record(*names: str) -> np.dtype:
    return np.dtype((np.record, [(name, np.float32) for name in names]))


# a Gaussian on the screen: center u v, inverse covariance [[a, b], [b, c]], opacity as blended, depth along the axis,
# half width and height of the box beyond which its alpha is under LEAST_ALPHA; red green blue as seen from here
SPLAT = _record("u", "v", "a", "b", "c", "opacity", "depth", "reach_x", "reach_y", "red", "green", "blue")
# gradients of a loss to these, summed over the pixels of one tile
SLOPES = _record("u", "v", "a", "b", "c", "opacity", "red", "green", "blue")
TILES = np.dtype((np.record, [(name, np.int32) for name in ("left", "right", "top", "bottom")]))  # ends are exclusive
# which Gaussian an entry of a tile is, and its row of slopes
ENTRY = np.dtype((np.record, [("gaussian", np.int32), ("slot", np.int32)]))
