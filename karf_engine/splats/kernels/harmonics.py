"""Real spherical harmonics up to degree 3 and their derivatives, with the order and signs of Kerbl et al. 2023."""

from __future__ import annotations

import numpy as np

from ...compute.kernels import kernel
from .arrays import C0

C1 = np.float32(0.4886025119029199)
C4, C6, C8 = np.float32(1.0925484305920792), np.float32(0.31539156525252005), np.float32(0.5462742152960396)
C9, C10, C11 = np.float32(0.5900435899266435), np.float32(2.890611442640554), np.float32(0.4570457994644658)
C12, C14 = np.float32(0.3731763325901154), np.float32(1.445305721320277)
TWO, THREE, FOUR, SIX, EIGHT = map(np.float32, (2, 3, 4, 6, 8))


@kernel
def harmonics(x, y, z, count, values):
    """Write the first `count` harmonics (1, 4, 9 or 16) of a unit direction."""
    values[0] = C0
    if count > 1:
        values[1], values[2], values[3] = -C1 * y, C1 * z, -C1 * x
    if count > 4:
        values[4], values[5], values[7] = C4 * x * y, -C4 * y * z, -C4 * x * z
        values[6] = C6 * (TWO * z * z - x * x - y * y)
        values[8] = C8 * (x * x - y * y)
    if count > 9:
        values[9] = -C9 * y * (THREE * x * x - y * y)
        values[10] = C10 * x * y * z
        values[11] = -C11 * y * (FOUR * z * z - x * x - y * y)
        values[12] = C12 * z * (TWO * z * z - THREE * x * x - THREE * y * y)
        values[13] = -C11 * x * (FOUR * z * z - x * x - y * y)
        values[14] = C14 * z * (x * x - y * y)
        values[15] = -C9 * x * (x * x - THREE * y * y)


@kernel
def harmonic_gradients(x, y, z, count, gradients):
    """Write the partial derivatives of the first `count` harmonics with respect to x, y, z, [count, 3]."""
    gradients[:count] = 0
    if count > 1:
        gradients[1, 1], gradients[2, 2], gradients[3, 0] = -C1, C1, -C1
    if count > 4:
        gradients[4, 0], gradients[4, 1] = C4 * y, C4 * x
        gradients[5, 1], gradients[5, 2] = -C4 * z, -C4 * y
        gradients[6, 0], gradients[6, 1], gradients[6, 2] = -TWO * C6 * x, -TWO * C6 * y, FOUR * C6 * z
        gradients[7, 0], gradients[7, 2] = -C4 * z, -C4 * x
        gradients[8, 0], gradients[8, 1] = TWO * C8 * x, -TWO * C8 * y
    if count > 9:
        xx, yy, zz = x * x, y * y, z * z
        gradients[9, 0], gradients[9, 1] = -SIX * C9 * x * y, -THREE * C9 * (xx - yy)
        gradients[10, 0], gradients[10, 1], gradients[10, 2] = C10 * y * z, C10 * x * z, C10 * x * y
        gradients[11, 0], gradients[11, 2] = TWO * C11 * x * y, -EIGHT * C11 * y * z
        gradients[11, 1] = -C11 * (FOUR * zz - xx - THREE * yy)
        gradients[12, 0], gradients[12, 1] = -SIX * C12 * x * z, -SIX * C12 * y * z
        gradients[12, 2] = C12 * (SIX * zz - THREE * xx - THREE * yy)
        gradients[13, 0] = -C11 * (FOUR * zz - THREE * xx - yy)
        gradients[13, 1], gradients[13, 2] = TWO * C11 * x * y, -EIGHT * C11 * x * z
        gradients[14, 0], gradients[14, 1], gradients[14, 2] = TWO * C14 * x * z, -TWO * C14 * y * z, C14 * (xx - yy)
        gradients[15, 0], gradients[15, 1] = -THREE * C9 * (xx - yy), SIX * C9 * x * y
