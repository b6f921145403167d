"""Squared differences between table rows, for total variation, and their gradients."""

from __future__ import annotations

import numpy as np

from ....compute.kernels import kernel, literal_kernel
from .arrays import BOTH
from .marching import TWO, ZERO
from .prefetching import prefetch

BLOCK_PAIRS = 2048  # per partial sum, so that sums do not depend on the threads
AHEAD = 8  # pairs between the prefetch of a row and its use


@kernel
def difference_sums(first, last, rows, other_rows, density, features, n_features, sums):
    """Write sums [blocks, 2] of squared differences of densities and features; pairs with a row of -1 are skipped."""
    for block in range(first, last):
        density_sum, feature_sum = 0.0, 0.0
        for pair in range(block * BLOCK_PAIRS, min(len(rows), (block + 1) * BLOCK_PAIRS)):
            prefetch_pair(pair, rows, other_rows, features, len(n_features))
            one, other = rows[pair], other_rows[pair]
            if one < 0 or other < 0:
                continue
            density_sum += (density[other] - density[one]) ** 2
            a = np.uint64(one) * np.uint64(len(n_features))
            b = np.uint64(other) * np.uint64(len(n_features))
            total = ZERO
            for number in range(len(n_features)):
                k = np.uint64(number)
                total += (features[b + k] - features[a + k]) ** 2
            feature_sum += total
        sums[block, 0], sums[block, 1] = density_sum, feature_sum


@kernel
def prefetch_pair(pair, rows, other_rows, table, n):
    """Prefetch both rows of n values of the pair AHEAD of this one."""
    pair += AHEAD
    if pair < len(rows):
        prefetch(table, np.int64(rows[pair]) * n)
        prefetch(table, np.int64(other_rows[pair]) * n)


@kernel
def difference_gradients(
    first, last, rows, other_rows, values, gradients, n_features, touched, density_factor, feature_factor
):
    """Add the gradients of both sums, times their factors, to table rows first to last."""
    for pair in range(len(rows)):
        one, other = rows[pair], other_rows[pair]
        if one < 0 or other < 0:
            continue
        has_one, has_other = first <= one < last, first <= other < last
        if has_one and has_other:
            prefetch_pair(pair, rows, other_rows, values.features, len(n_features))
            prefetch_pair(pair, rows, other_rows, gradients.features, len(n_features))
            add_pair_gradient(one, other, values, gradients, n_features, touched, density_factor, feature_factor)
        elif has_one:
            add_row_gradient(one, other, values, gradients, n_features, touched, density_factor, feature_factor)
        elif has_other:
            add_row_gradient(other, one, values, gradients, n_features, touched, density_factor, feature_factor)


@literal_kernel
def add_pair_gradient(one, other, values, gradients, n_features, touched, density_factor, feature_factor):
    """Add the gradients of one pair to both rows."""
    touched[one] = touched[other] = BOTH
    gradient = TWO * density_factor * (values.densities[other] - values.densities[one])
    gradients.densities[one] -= gradient
    gradients.densities[other] += gradient
    a = np.uint64(one) * np.uint64(len(n_features))
    b = np.uint64(other) * np.uint64(len(n_features))
    for number in range(len(n_features)):
        k = np.uint64(number)
        gradient = TWO * feature_factor * (values.features[b + k] - values.features[a + k])
        gradients.features[a + k] -= gradient
        gradients.features[b + k] += gradient


@literal_kernel
def add_row_gradient(row, other, values, gradients, n_features, touched, density_factor, feature_factor):
    """Add the gradients of one pair to the first row alone; another thread owns the other one."""
    touched[row] = BOTH
    gradients.densities[row] -= TWO * density_factor * (values.densities[other] - values.densities[row])
    a = np.uint64(row) * np.uint64(len(n_features))
    b = np.uint64(other) * np.uint64(len(n_features))
    for number in range(len(n_features)):
        k = np.uint64(number)
        gradients.features[a + k] -= TWO * feature_factor * (values.features[b + k] - values.features[a + k])
