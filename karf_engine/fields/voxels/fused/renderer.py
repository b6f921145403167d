"""`Renderer` (see ../renderer.py) by compiled kernels, for fields on the processor."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import core_count, limit_torch_threads, parallel_for
from ....compute.runtime import Runtime
from ...rendering.rays import Rays, spherical_harmonics
from ..field import VoxelField
from ..renderer import PointSupervision, RayBatch, RaySums
from .adam import LazyAdam
from .arrays import SORTED_POINT, MarchSettings, Network, SampleGradients, Samples, SortedSamples, new_rays, new_samples
from .coloring import color_samples, composite
from .gradients import ray_gradients, slab_gradients
from .marching import CHUNK, bin_offsets, count_bins, march, mark_visible, write_sorted
from .ray_paths import paths_of
from .smoothing import BLOCK_PAIRS, difference_gradients, difference_sums
from .tables import FieldTables, network_of

BINS = 65536  # of the sort by position
SLABS = 24  # of the grid, for parallel gradients


class FusedRenderer:
    """Renderer of one field (see choice.new_renderer)."""

    def __init__(
        self, field: VoxelField, runtime: Runtime, unit: float, russian_roulette: float, supervision: PointSupervision
    ) -> None:
        limit_torch_threads()
        self.field, self.runtime = field, runtime
        self.tables = FieldTables(field)
        self._settings = MarchSettings(
            64 * CHUNK,
            0,
            np.float32(1),
            *map(np.float32, (russian_roulette, supervision.margin, supervision.off_path, unit)),
        )
        self._n_slots = -1  # nothing is allocated
        self._samples: Samples
        self._gradients: SampleGradients
        self._ordered: SortedSamples

    def optimizer(self, groups: list[dict], betas: tuple[float, float]) -> LazyAdam:
        return LazyAdam(groups, betas, self.tables, self.runtime.process_group)

    def render(self, batch: RayBatch) -> RaySums:
        sums = _Render.apply(self.field.raw_density, self, batch)
        color, rest = sums[:, :3], sums[:, 3:].unbind(1)
        final_transmittance, distortion, before, up_to, distance, square, alpha = rest
        observes = torch.from_numpy(self._rays.reach >= 0)
        n_samples = int(self._rays.counts.sum())
        return RaySums(
            color, final_transmittance, distortion, before, up_to, observes, distance, square, alpha, n_samples
        )

    def differences(self, rows: Tensor, other_rows: Tensor) -> tuple[Tensor, Tensor]:
        return _Differences.apply(self.field.raw_density, self, rows.int().numpy(), other_rows.int().numpy()).unbind(0)

    def visibility(self, batches: Iterable[Rays]) -> Tensor:
        visibility = np.zeros(len(self.field.raw_density), np.float32)
        for rays in batches:
            self._march(RayBatch(rays, 1.0, torch.full((len(rays),), 0.5)))
            mark_visible(self._n_chunks, self._samples, self._settings.capacity, visibility)
        return torch.from_numpy(visibility)[self.field.lowest_rows()]

    def is_free(self, rays: Rays, step: float) -> Tensor:
        self._march(RayBatch(rays, step, torch.full((len(rays),), 0.5)))
        return torch.from_numpy(self._rays.counts == 0)

    def forward(self, batch: RayBatch) -> Tensor:
        """Return the sums of each ray, [R, N_SUMS], in the order of arrays.RED to ALPHA."""
        self._march(batch)
        samples, ordered, tables = self._samples, self._ordered, self.tables
        total = self._sort_by_position()
        self._harmonics = spherical_harmonics(batch.rays.viewdirs).numpy()
        self._network, self._is_diffuse = network_of(self.field), batch.is_diffuse
        self._total = total
        parallel_for(
            color_samples, total, ordered, samples, tables.values.features, self._harmonics, self._network,
            tables.n_features, tables.n_hidden, batch.is_diffuse,
        )  # fmt: skip
        parallel_for(composite, len(batch.rays), self._rays, samples)
        return torch.from_numpy(self._rays.sums)

    def backward(self, gradients: Tensor) -> None:
        """Accumulate the gradients of tables and network from those of the last batch's sums [R, N_SUMS]."""
        tables, settings, ordered = self.tables, self._settings, self._ordered
        parallel_for(
            ray_gradients, len(gradients), self._rays, self._samples, gradients.contiguous().numpy(), settings.margin,
            settings.unit, np.float32(settings.step * self.field.voxel), self._gradients,
        )  # fmt: skip
        cuts = self._cuts()
        n_slabs = len(cuts) - 1
        sums = Network(*(np.zeros((n_slabs, *part.shape), np.float32) for part in self._network))
        for offset in range(2):  # even slabs share no vertex, neither do odd ones
            parallel_for(
                slab_gradients, (n_slabs + 1 - offset) // 2, offset, cuts, ordered, self._gradients,
                self._harmonics, self._network, tables.gradients, tables.touched, sums, tables.n_features,
                tables.n_hidden, self._is_diffuse,
            )  # fmt: skip
        self.tables.expose_gradients()
        if not self._is_diffuse:
            hidden, output = self.field.color_layers
            w1, b1, w2, b2 = (torch.from_numpy(part.sum(0)) for part in sums)
            parameters = hidden.weight, hidden.bias, output.weight, output.bias
            for parameter, gradient in zip(parameters, (w1.T, b1, w2, b2), strict=True):
                parameter.grad = gradient.contiguous() if parameter.grad is None else parameter.grad + gradient

    def _sort_by_position(self) -> int:
        """Sort the samples by plane of the grid and part of the plane; return their number."""
        grid, samples, ordered, bins = self.tables.grid, self._samples, self._ordered, self._ordered.bins
        capacity, n_spans = self._settings.capacity, len(bins)
        cuts = np.arange(n_spans + 1) * self._n_chunks // n_spans
        parallel_for(count_bins, n_spans, cuts, grid, samples, bins, capacity)
        total = bin_offsets(len(ordered.planes) - 1, bins, ordered.planes)
        parallel_for(write_sorted, n_spans, cuts, grid, samples, ordered, bins, capacity)
        return total

    def _cuts(self) -> np.ndarray:
        """Return the first sample of each slab, and the number of samples. Slabs are whole planes with similar counts."""
        wanted = np.searchsorted(self._ordered.planes, self._total * np.arange(1, SLABS) / SLABS)
        return np.concatenate([[0], self._ordered.planes[np.unique(wanted)], [self._total]])

    def _march(self, batch: RayBatch) -> None:
        n_rays = len(batch.rays)
        self._n_chunks = -(-n_rays // CHUNK)
        observed = np.zeros((0, 3), np.float32) if batch.observed is None else batch.observed.numpy()
        paths = paths_of(self.field.space, self.field.bounds, batch.rays)
        self._rays = new_rays(paths, batch.jitter.numpy(), observed)
        seed = int(self.runtime.randint(2**31 - 1, 1)) if self._settings.russian_roulette else 0
        self._settings = self._settings._replace(seed=seed, step=np.float32(batch.step))
        self._grow(self._settings.capacity)
        while True:
            parallel_for(march, self._n_chunks, self.tables.grid, self._rays, self._samples, self._settings)
            if self._samples.counts[: self._n_chunks].max(initial=0) < self._settings.capacity:
                return
            self._grow(self._settings.capacity * 3 // 2)

    def _grow(self, capacity: int) -> None:
        """Ensure `capacity` sample slots per chunk."""
        size = self._n_chunks * capacity
        self._settings = self._settings._replace(capacity=capacity)
        if self._n_slots >= size:
            return
        self._n_slots = size
        n_planes = self.field.occupied.shape[0] + 1
        self._samples = new_samples(self._n_chunks, capacity)
        weights, densities = np.empty(size, np.float32), np.empty(size, np.float32)
        self._gradients = SampleGradients(weights, densities, self._samples.colors)
        self._ordered = SortedSamples(
            np.empty(size, np.int32),
            np.empty((size, 4), np.int32),
            np.empty(size, np.int32),
            np.empty(size, SORTED_POINT),
            np.empty((size, self.field.n_features), np.float32),
            np.empty((core_count(), max(1, BINS // n_planes) * n_planes), np.int32),
            np.empty(n_planes + 1, np.int64),
        )


class _Render(torch.autograd.Function):
    """Rendering as a torch operation. The densities only mark it as differentiable; kernels write the gradients."""

    @staticmethod
    def forward(context: Any, densities: Tensor, renderer: FusedRenderer, batch: RayBatch) -> Tensor:
        del densities
        context.renderer = renderer
        return renderer.forward(batch)

    @staticmethod
    def backward(context: Any, gradients: Tensor) -> tuple[None, None, None]:
        context.renderer.backward(gradients)
        return None, None, None


class _Differences(torch.autograd.Function):
    """Squared differences between rows as a torch operation, of densities and of features, [2]."""

    @staticmethod
    def forward(
        context: Any, densities: Tensor, renderer: FusedRenderer, rows: np.ndarray, other_rows: np.ndarray
    ) -> Tensor:
        del densities
        context.renderer, context.pairs = renderer, (rows, other_rows)
        tables = renderer.tables
        sums = np.zeros((-(-len(rows) // BLOCK_PAIRS), 2))
        parallel_for(difference_sums, len(sums), rows, other_rows, *tables.values, tables.n_features, sums)
        return torch.from_numpy(sums.sum(0)).float()

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[None, None, None, None]:
        tables = context.renderer.tables
        density, features = (np.float32(value) for value in gradient.tolist())
        parallel_for(
            difference_gradients, len(tables.touched), *context.pairs, tables.values, tables.gradients,
            tables.n_features, tables.touched, density, features,
        )  # fmt: skip
        tables.expose_gradients()
        return None, None, None, None
