"""Compiled kernels for the Gaussian layer's bases and their gradients, row by row. For the formulas see `grbf`."""

from __future__ import annotations

import numpy as np
from numpy import float32, int32

from ..compute.kernels import allocating_kernel, kernel

ONE, HALF = float32(1), float32(0.5)
MIN_EXPONENT, MAX_EXPONENT = float32(-87), float32(88)
# exp(x) = 2^n exp(r) with |r| <= ln(2) / 2, by the polynomial of Cephes' expf; ln(2) in two parts
LOG2_E, LN2_HIGH, LN2_LOW = float32(1.44269504), float32(0.693359375), float32(-2.12194440e-4)
C0, C1, C2 = float32(1.9875691500e-4), float32(1.3981999507e-3), float32(8.3334519073e-3)
C3, C4, C5 = float32(4.1665795894e-2), float32(1.6666665459e-1), float32(5.0000001201e-1)


@kernel
def exponentials(x, powers, out):
    """Write exp(x) [n] to `out`; numba does not vectorize np.exp. powers: [n] scratch."""
    bits = powers.view(int32)
    for i in range(len(x)):
        value = min(max(x[i], MIN_EXPONENT), MAX_EXPONENT)
        n = np.floor(value * LOG2_E + HALF)
        r = value - n * LN2_HIGH
        r = r - n * LN2_LOW
        polynomial = ((((C0 * r + C1) * r + C2) * r + C3) * r + C4) * r + C5
        out[i] = polynomial * r * r + r + ONE
        bits[i] = (int32(n) + int32(127)) << int32(23)
    for i in range(len(x)):
        out[i] *= powers[i]


@allocating_kernel
def fill_blocks(x, u, anchor, constants, blocks):
    """Write the Gaussians of u [rows, n_in] and SiLU(x), all times exp(shift), to `blocks` [rows, N + 1, n_in].

    constants: see `grbf._Recurrence`.
    """
    origin, steps, lowest, highest, kappa, shift, decay, exp_shift = constants
    n, n_in = blocks.shape[1] - 1, x.shape[1]
    exponents, powers = np.empty(n_in, float32), np.empty(n_in, float32)
    upward, downward = np.empty(n_in, float32), np.empty(n_in, float32)
    for row in range(len(x)):
        bases = blocks[row]
        for i in range(n_in):
            w = min(max((u[row, i] - origin) * steps, lowest), highest)
            exponents[i] = shift - HALF * kappa * w * w
            downward[i] = kappa * (w - HALF)
        exponentials(exponents, powers, bases[anchor])
        exponentials(downward, powers, upward)
        for i in range(n_in):
            downward[i] = decay / upward[i]
        for k in range(anchor + 1, n):
            for i in range(n_in):
                bases[k, i] = bases[k - 1, i] * upward[i]
                upward[i] *= decay
        for k in range(anchor - 1, -1, -1):
            for i in range(n_in):
                bases[k, i] = bases[k + 1, i] * downward[i]
                downward[i] *= decay
        for i in range(n_in):
            exponents[i] = -x[row, i]
        exponentials(exponents, powers, upward)
        for i in range(n_in):
            bases[n, i] = x[row, i] * exp_shift / (ONE + upward[i])


@allocating_kernel
def fill_gradients(x, u, anchor, constants, blocks, products, grad_x, grad_u):
    """Write gradients of x and u (up to a factor), and return the sum of w (w E - 2 sum_j j E_j), E = sum_j E_j.

    products: [rows, N + 1, n_in], dL/dB_k, then dL/dSiLU. The others are those of `fill_blocks`, which wrote `blocks`.
    """
    origin, steps, lowest, highest = constants[:4]
    n, n_in = blocks.shape[1] - 1, x.shape[1]
    exponents, powers, growth = np.empty(n_in, float32), np.empty(n_in, float32), np.empty(n_in, float32)
    total, moment = np.empty(n_in, float32), np.empty(n_in, float32)
    quadratic = 0.0
    for row in range(len(x)):
        for i in range(n_in):
            exponents[i] = -x[row, i]
        exponentials(exponents, powers, growth)
        for i in range(n_in):
            gate = ONE / (ONE + growth[i])
            grad_x[row, i] = products[row, n, i] * gate * (ONE + x[row, i] * (ONE - gate))
        total[:] = 0
        moment[:] = 0
        for k in range(n):
            j = float32(k - anchor)
            for i in range(n_in):
                share = products[row, k, i] * blocks[row, k, i]
                total[i] += share
                moment[i] += j * share
        own = float32(0)
        for i in range(n_in):
            w = min(max((u[row, i] - origin) * steps, lowest), highest)
            weighted = total[i] * w
            grad_u[row, i] = moment[i] - weighted
            own += w * (weighted - moment[i] - moment[i])
        quadratic += own
    return quadratic
