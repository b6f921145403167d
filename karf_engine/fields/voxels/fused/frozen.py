"""A frozen field, rendered by kernels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import share, take_from_torch
from ...rendering.rays import Rays
from ...rendering.sampling import Samples
from ...rendering.spherical_harmonics import spherical_harmonics
from ...rendering.volume import Trace
from ..grid import VoxelGrid
from .arrays import FINAL_TRANSMITTANCE, Limits, RayArrays, new_rays, new_samples
from .arrays import Samples as Chunks
from .asking import colors_at, features_at, pack
from .bending import paths_of
from .marching import CHUNK, march
from .tables import flat, grid_of, network_of

CAPACITY = 64 * CHUNK  # samples that a chunk of rays may have at first
NOTHING = np.zeros((0, 3), np.float32)


class FrozenField:
    """What kernels read of a field that changes no more."""

    def __init__(self, field: VoxelGrid) -> None:
        take_from_torch()
        self._space, self._bounds = field.space, field.bounds
        self._grid, self._network = grid_of(field), network_of(field)
        self._features = flat(field.feature_table)
        self._n_features, self._n_hidden = (0,) * field.n_features, (0,) * field.width
        self._capacity = CAPACITY

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Where these rays end (see `VoxelField.trace`); what lies behind the last of their light is left out."""
        step = np.float32(step_in_voxels)
        arrays = new_rays(paths_of(self._space, self._bounds, rays), np.full(len(rays), 0.5, np.float32), NOTHING)
        chunks = self._march(arrays, step)
        starts = np.cumsum(chunks.counts) - chunks.counts
        total = int(chunks.counts.sum())
        indices, distances = np.empty(total, np.int64), np.empty(total, np.float32)
        positions, weights = np.empty((total, 3), np.float32), np.empty(total, np.float32)
        capacity = len(chunks.rays) // max(1, len(starts))
        share(pack, len(starts), self._grid, chunks, capacity, starts, indices, distances, positions, weights)
        indices, distances, positions, weights = map(torch.from_numpy, (indices, distances, positions, weights))
        samples = Samples(indices, distances, positions, float(step * self._grid.voxel))
        return Trace(samples, weights, torch.from_numpy(arrays.sums[:, FINAL_TRANSMITTANCE].copy()))

    def features(self, positions: Tensor) -> Tensor:
        """Prior features [n, F] at positions [n, 3] (see `VoxelField.features`)."""
        result = np.empty((len(positions), len(self._n_features)), np.float32)
        at = positions.contiguous().numpy()
        share(features_at, len(at), self._grid, at, self._features, self._n_features, result)
        return torch.from_numpy(result)

    def color(self, viewdirs: Tensor, features: Tensor) -> Tensor:
        """Colors [n, 3] of features [n, F] seen along viewdirs [n, 3] (see `VoxelField.color`)."""
        result = np.empty((len(features), 3), np.float32)
        harmonics = spherical_harmonics(viewdirs).numpy()
        own = features.contiguous().numpy()
        share(colors_at, len(own), own, harmonics, self._network, self._n_features, self._n_hidden, result)
        return torch.from_numpy(result)

    def _march(self, rays: RayArrays, step: np.float32) -> Chunks:
        """Samples of these rays in chunks of equal room."""
        n_chunks, one, none = -(-len(rays.jitter) // CHUNK), np.float32(1), np.float32(0)
        while True:
            capacity = self._capacity
            samples = new_samples(n_chunks, capacity)
            share(march, n_chunks, self._grid, rays, samples, Limits(capacity, 0, step, none, none, none, one))
            if samples.counts.max(initial=0) < capacity:
                return samples
            self._capacity = capacity * 3 // 2
