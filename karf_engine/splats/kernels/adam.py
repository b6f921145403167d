"""Adam's step (Kingma and Ba 2015) of the Gaussians that a picture shows; the others rest."""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import kernel
from .arrays import LOG_SCALE, ONE

MEAN, SQUARE, EPSILON = np.float32(0.9), np.float32(0.99), np.float32(1e-15)


@kernel
def adam(first, last, table, gradients, means, squares, steps, slots, rates, sizes, least):
    """Step the rows first to last that have slots.

    Args:
        first: Row.
        last: Row.
        table: [n, P].
        gradients: [n, P].
        means: [n, P], first moments.
        squares: [n, P], second moments.
        steps: [n], how often each row has stepped.
        slots: [n + 1], see `tiles.count_entries`.
        rates: [P], of the centers in sizes.
        sizes: [n], the Gaussians' sizes, world units.
        least: [n], logarithm of the least scale.
    """
    for g in range(first, last):
        if slots[g + 1] == slots[g]:
            continue
        steps[g] += 1
        count = float(steps[g])
        correction = ONE / np.float32(ONE - math.exp(count * math.log(MEAN)))
        root = np.float32(ONE / math.sqrt(ONE - math.exp(count * math.log(SQUARE))))
        for k in range(table.shape[1]):
            gradient = gradients[g, k]
            means[g, k] = MEAN * means[g, k] + (ONE - MEAN) * gradient
            squares[g, k] = SQUARE * squares[g, k] + (ONE - SQUARE) * gradient * gradient
            step = rates[k] * correction * means[g, k] / (math.sqrt(squares[g, k]) * root + EPSILON)
            table[g, k] -= step * sizes[g] if k < LOG_SCALE else step
        for k in range(LOG_SCALE, LOG_SCALE + 3):
            table[g, k] = max(table[g, k], least[g])
