"""Adam (Kingma and Ba 2015) for the Gaussians that a picture shows."""

from __future__ import annotations

import math

import numpy as np

from ...compute.kernels import kernel
from .arrays import LOG_SCALE, ONE

BETA1, BETA2, EPSILON = np.float32(0.9), np.float32(0.99), np.float32(1e-15)


@kernel
def adam(first, last, table, gradients, means, squares, steps, offsets, rates, sizes, least):
    """Update the visible rows first to last of the table [n, P] from gradients, first and second moments [n, P].

    steps: [n], updates of each row. offsets: [n + 1], see `count_entries`. rates: [P], learning rates; of the centers
    in units of the sizes [n]. least: [n], log of the least scale.
    """
    for g in range(first, last):
        if offsets[g + 1] == offsets[g]:
            continue
        steps[g] += 1
        count = float(steps[g])
        correction = ONE / np.float32(ONE - math.exp(count * math.log(BETA1)))
        root = np.float32(ONE / math.sqrt(ONE - math.exp(count * math.log(BETA2))))
        for k in range(table.shape[1]):
            gradient = gradients[g, k]
            means[g, k] = BETA1 * means[g, k] + (ONE - BETA1) * gradient
            squares[g, k] = BETA2 * squares[g, k] + (ONE - BETA2) * gradient * gradient
            step = rates[k] * correction * means[g, k] / (math.sqrt(squares[g, k]) * root + EPSILON)
            table[g, k] -= step * sizes[g] if k < LOG_SCALE else step
        for k in range(LOG_SCALE, LOG_SCALE + 3):
            table[g, k] = max(table[g, k], least[g])
