"""Kernels of frozen fields: packed samples, features at positions, colors along directions."""

from __future__ import annotations

import numpy as np

from ....compute.kernels import allocating_kernel, kernel
from .coloring import GROUP, N_HARMONICS, gather, hidden_layers, logits, sigmoid
from .marching import ONE, ZERO, corners_of, row_of


@kernel
def pack(first_chunk, last_chunk, grid, samples, capacity, starts, rays, distances, positions, weights):
    """Copy samples without the empty slots. starts: first packed sample of each chunk."""
    row, plane = grid.row_stride, grid.plane_stride
    low_x, low_y, low_z = grid.minimum[0], grid.minimum[1], grid.minimum[2]
    for chunk in range(first_chunk, last_chunk):
        for number in range(samples.counts[chunk]):
            sample, packed = chunk * capacity + number, starts[chunk] + number
            vertex, point = samples.vertices[sample], samples.points[sample]
            i = vertex // plane
            j = (vertex - i * plane) // row
            k = vertex - i * plane - j * row
            positions[packed, 0] = low_x + (np.float32(i) + point.x) * grid.voxel
            positions[packed, 1] = low_y + (np.float32(j) + point.y) * grid.voxel
            positions[packed, 2] = low_z + (np.float32(k) + point.z) * grid.voxel
            distances[packed] = point.distance
            rays[packed] = samples.rays[sample]
            weights[packed] = samples.light[sample].weight


@kernel
def features_at(first, last, grid, positions, features, n_features, out):
    """Interpolate features [n, F] at positions first to last."""
    for number in range(first, last):
        x = (positions[number, 0] - grid.minimum[0]) / grid.voxel
        y = (positions[number, 1] - grid.minimum[1]) / grid.voxel
        z = (positions[number, 2] - grid.minimum[2]) / grid.voxel
        i = min(max(int(x), 0), grid.cells.x - 1)
        j = min(max(int(y), 0), grid.cells.y - 1)
        k = min(max(int(z), 0), grid.cells.z - 1)
        x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
        vertex = i * grid.plane_stride + j * grid.row_stride + k
        if (grid.bits[(i * grid.cells.y + j) * grid.row_bytes + (k >> 3)] >> (k & 7)) & 1:
            gather(features, corners_of(grid, vertex), x, y, z, len(n_features), out[number])
        else:
            gather_partial(grid, vertex, x, y, z, features, len(n_features), out[number])


@kernel
def gather_partial(grid, vertex, x, y, z, features, n, out):
    """Interpolate n features in an unoccupied cell; vertices without a row count as 0."""
    out[:] = ZERO
    for corner in range(8):
        i, j, k = corner >> 2 & 1, corner >> 1 & 1, corner & 1
        number = vertex + i * grid.plane_stride + j * grid.row_stride + k
        if (grid.index[number >> 3] >> (number & 7)) & 1:
            row = row_of(grid.index, number)
            weight = (x if i else ONE - x) * (y if j else ONE - y) * (z if k else ONE - z)
            for feature in range(n):
                out[feature] += weight * features[row * n + feature]


@allocating_kernel
def colors_at(first, last, features, harmonics, network, n_features, n_hidden, out):
    """Compute sRGB colors [n, 3] from features [n, F] and harmonics of the directions [n, 9], rows first to last."""
    inputs = np.zeros((GROUP, len(n_features) + N_HARMONICS), np.float32)
    hidden = np.zeros((GROUP, len(n_hidden)), np.float32)
    for start in range(first, last, GROUP):
        count = min(GROUP, last - start)
        for member in range(count):
            for number in range(len(n_features)):
                inputs[member, number] = features[start + member, number]
            for number in range(N_HARMONICS):
                inputs[member, len(n_features) + number] = harmonics[start + member, number]
        hidden_layers(inputs, network, hidden)
        for member in range(count):
            red, green, blue = logits(features[start + member], hidden[member], network)
            color = out[start + member]
            color[0], color[1], color[2] = sigmoid(red), sigmoid(green), sigmoid(blue)
