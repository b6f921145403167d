"""Queries of a frozen field by compiled kernels."""

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import limit_torch_threads, parallel_for
from ....compute.kernels import allocating_kernel, kernel
from ...rendering.rays import Rays, spherical_harmonics
from ...rendering.sampling import Samples
from ...rendering.volume import Trace
from ..grid import VoxelGrid
from . import arrays
from .arrays import ONE, ZERO
from .coloring import GROUP, N_HARMONICS, gather, hidden_layers, logits, sigmoid
from .marching import CHUNK, corners_of, march, paths_of, row_of

CAPACITY = 64 * CHUNK  # initial sample slots per chunk of rays


class FrozenField:
    """Arrays of a field that no longer changes."""

    def __init__(self, field: VoxelGrid) -> None:
        limit_torch_threads()
        self._space, self._bounds = field.space, field.bounds
        self._grid, self._network = arrays.grid_of(field), arrays.network_of(field)
        self._features = arrays.flat(field.feature_table)
        self._n_features, self._n_hidden = (0,) * field.n_features, (0,) * field.width
        self._capacity = CAPACITY

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Render ray weights (see `VoxelField.trace`); rays are terminated at a transmittance of marching.DARK."""
        step = np.float32(step_in_voxels)
        batch = arrays.new_rays(
            paths_of(self._space, self._bounds, rays), np.full(len(rays), 0.5, np.float32), np.zeros((0, 3), np.float32)
        )
        chunks = self._march(batch, step)
        starts = np.cumsum(chunks.counts) - chunks.counts
        total = int(chunks.counts.sum())
        indices, distances = np.empty(total, np.int64), np.empty(total, np.float32)
        positions, weights = np.empty((total, 3), np.float32), np.empty(total, np.float32)
        capacity = len(chunks.rays) // max(1, len(starts))
        parallel_for(pack, len(starts), self._grid, chunks, capacity, starts, indices, distances, positions, weights)
        indices, distances, positions, weights = map(torch.from_numpy, (indices, distances, positions, weights))
        samples = Samples(indices, distances, positions, float(step * self._grid.voxel))
        return Trace(samples, weights, torch.from_numpy(batch.sums["final_transmittance"].copy()))

    def features(self, positions: Tensor) -> Tensor:
        """Return prior features [n, F] at positions [n, 3] (see `VoxelField.features`)."""
        result = np.empty((len(positions), len(self._n_features)), np.float32)
        points = positions.contiguous().numpy()
        parallel_for(features_at, len(points), self._grid, points, self._features, self._n_features, result)
        return torch.from_numpy(result)

    def color(self, viewdirs: Tensor, features: Tensor) -> Tensor:
        """Return colors [n, 3] of features [n, F] seen along viewdirs [n, 3] (see `VoxelField.color`)."""
        result = np.empty((len(features), 3), np.float32)
        harmonics = spherical_harmonics(viewdirs).numpy()
        inputs = features.contiguous().numpy()
        parallel_for(colors_at, len(inputs), inputs, harmonics, self._network, self._n_features, self._n_hidden, result)
        return torch.from_numpy(result)

    def _march(self, rays: arrays.RayArrays, step: np.float32) -> arrays.Samples:
        """March rays, with more slots until all samples fit."""
        n_chunks = -(-len(rays.jitter) // CHUNK)
        while True:
            capacity = self._capacity
            samples = arrays.new_samples(n_chunks, capacity)
            settings = arrays.MarchSettings(capacity, 0, step, ZERO, ZERO, ZERO, ONE)
            parallel_for(march, n_chunks, self._grid, rays, samples, settings)
            if samples.counts.max(initial=0) < capacity:
                return samples
            self._capacity = capacity * 3 // 2


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
