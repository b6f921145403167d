"""Queries of a frozen field by compiled kernels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import limit_torch_threads, parallel_for
from ...rendering.rays import Rays, spherical_harmonics
from ...rendering.sampling import Samples
from ...rendering.volume import Trace
from ..grid import VoxelGrid
from .arrays import FINAL_TRANSMITTANCE, MarchSettings, RayArrays, new_rays, new_samples
from .arrays import Samples as Chunks
from .field_queries import colors_at, features_at, pack
from .marching import CHUNK, march
from .ray_paths import paths_of
from .tables import flat, grid_of, network_of

CAPACITY = 64 * CHUNK  # initial sample slots per chunk of rays
NO_POINTS = np.zeros((0, 3), np.float32)


class FrozenField:
    """Arrays of a field that no longer changes."""

    def __init__(self, field: VoxelGrid) -> None:
        limit_torch_threads()
        self._space, self._bounds = field.space, field.bounds
        self._grid, self._network = grid_of(field), network_of(field)
        self._features = flat(field.feature_table)
        self._n_features, self._n_hidden = (0,) * field.n_features, (0,) * field.width
        self._capacity = CAPACITY

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Render ray weights (see `VoxelField.trace`); rays are terminated at a transmittance of marching.DARK."""
        step = np.float32(step_in_voxels)
        arrays = new_rays(paths_of(self._space, self._bounds, rays), np.full(len(rays), 0.5, np.float32), NO_POINTS)
        chunks = self._march(arrays, step)
        starts = np.cumsum(chunks.counts) - chunks.counts
        total = int(chunks.counts.sum())
        indices, distances = np.empty(total, np.int64), np.empty(total, np.float32)
        positions, weights = np.empty((total, 3), np.float32), np.empty(total, np.float32)
        capacity = len(chunks.rays) // max(1, len(starts))
        parallel_for(pack, len(starts), self._grid, chunks, capacity, starts, indices, distances, positions, weights)
        indices, distances, positions, weights = map(torch.from_numpy, (indices, distances, positions, weights))
        samples = Samples(indices, distances, positions, float(step * self._grid.voxel))
        return Trace(samples, weights, torch.from_numpy(arrays.sums[:, FINAL_TRANSMITTANCE].copy()))

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

    def _march(self, rays: RayArrays, step: np.float32) -> Chunks:
        """March rays, with more slots until all samples fit."""
        n_chunks, one, zero = -(-len(rays.jitter) // CHUNK), np.float32(1), np.float32(0)
        while True:
            capacity = self._capacity
            samples = new_samples(n_chunks, capacity)
            parallel_for(
                march, n_chunks, self._grid, rays, samples, MarchSettings(capacity, 0, step, zero, zero, zero, one)
            )
            if samples.counts.max(initial=0) < capacity:
                return samples
            self._capacity = capacity * 3 // 2
