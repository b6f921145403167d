"""What later stages ask of a frozen field: samples of rays in one row, features at places, colors along directions."""

from __future__ import annotations

import numpy as np

from ....compute.kernels import allocating_kernel, kernel
from .coloring import GROUP, N_HARMONICS, gather, hidden_layers, logits, sigmoid
from .marching import ONE, ZERO, corners_of, row_of


@kernel
def pack(first_chunk, last_chunk, grid, samples, capacity, starts, rays, distances, positions, weights):
    """Samples without the gaps between chunks. starts: where each chunk's begin there."""
    row, plane = grid.row_stride, grid.plane_stride
    low_x, low_y, low_z = grid.minimum[0], grid.minimum[1], grid.minimum[2]
    for chunk in range(first_chunk, last_chunk):
        for number in range(samples.counts[chunk]):
            sample, at = chunk * capacity + number, starts[chunk] + number
            vertex, place = samples.vertices[sample], samples.places[sample]
            i = vertex // plane
            j = (vertex - i * plane) // row
            k = vertex - i * plane - j * row
            positions[at, 0] = low_x + (np.float32(i) + place.x) * grid.voxel
            positions[at, 1] = low_y + (np.float32(j) + place.y) * grid.voxel
            positions[at, 2] = low_z + (np.float32(k) + place.z) * grid.voxel
            distances[at] = place.distance
            rays[at] = samples.rays[sample]
            weights[at] = samples.light[sample].weight


@kernel
def features_at(first, last, grid, positions, features, n_features, out):
    """Features [n, F] at the positions first to last, as `VoxelField.features` has them."""
    for at in range(first, last):
        x = (positions[at, 0] - grid.minimum[0]) / grid.voxel
        y = (positions[at, 1] - grid.minimum[1]) / grid.voxel
        z = (positions[at, 2] - grid.minimum[2]) / grid.voxel
        i = min(max(int(x), 0), grid.cells.x - 1)
        j = min(max(int(y), 0), grid.cells.y - 1)
        k = min(max(int(z), 0), grid.cells.z - 1)
        x, y, z = x - np.float32(i), y - np.float32(j), z - np.float32(k)
        vertex = i * grid.plane_stride + j * grid.row_stride + k
        if (grid.bits[(i * grid.cells.y + j) * grid.row_bytes + (k >> 3)] >> (k & 7)) & 1:
            gather(features, corners_of(grid, vertex), x, y, z, len(n_features), out[at])
        else:
            gather_some(grid, vertex, x, y, z, features, len(n_features), out[at])


@kernel
def gather_some(grid, vertex, x, y, z, features, n, out):
    """The n features of a place in a cell that is not occupied: a vertex without a row counts nothing."""
    out[:] = ZERO
    for corner in range(8):
        i, j, k = corner >> 2 & 1, corner >> 1 & 1, corner & 1
        number = vertex + i * grid.plane_stride + j * grid.row_stride + k
        if (grid.index[number >> 3] >> (number & 7)) & 1:
            found = row_of(grid.index, number)
            weight = (x if i else ONE - x) * (y if j else ONE - y) * (z if k else ONE - z)
            for feature in range(n):
                out[feature] += weight * features[found * n + feature]


@allocating_kernel
def colors_at(first, last, features, harmonics, network, n_features, n_hidden, out):
    """sRGB colors [n, 3] of the features [n, F] and harmonics of directions [n, 9] first to last."""
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
