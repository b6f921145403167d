"""The kernels in their order: a `Renderer` (see ../renderer.py) for fields on the processor."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import count, share, take_from_torch
from ....compute.runtime import Runtime
from ...rendering.rays import Rays
from ...rendering.spherical_harmonics import spherical_harmonics
from ..field import VoxelField
from ..renderer import PointSupervision, RayBatch, RaySums
from .adam import LazyAdam
from .arrays import (
    SHARED_PLACE,
    Limits,
    Network,
    SampleGradients,
    Samples,
    Sorted,
    new_rays,
    new_sample_gradients,
    new_samples,
)
from .bending import paths_of
from .coloring import color_samples, composite
from .gradients import ray_gradients, slab_gradients
from .marching import CHUNK, count_places, march, mark_visible, place_bins, put_in_place
from .smoothing import BLOCK_PAIRS, difference_gradients, difference_sums
from .tables import FieldTables

BINS = 65536  # of the sort by place
SLABS = 24  # of the grid, whose gradients are computed side by side


class FusedRenderer:
    """Renders and learns one field of the processor's memory."""

    def __init__(
        self, field: VoxelField, runtime: Runtime, unit: float, russian_roulette: float, supervision: PointSupervision
    ) -> None:
        """See ../renderer.py: new_renderer."""
        take_from_torch()
        self.field, self.runtime = field, runtime
        self.tables = FieldTables(field)
        self._limits = Limits(
            64 * CHUNK,
            0,
            np.float32(1),
            *map(np.float32, (russian_roulette, supervision.margin, supervision.off_path, unit)),
        )
        self._samples: Samples | None = None
        self._gradients: SampleGradients | None = None
        self._ordered: Sorted | None = None

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
            mark_visible(self._n_chunks, self._samples, self._limits.capacity, visibility)
        return torch.from_numpy(visibility)[self.field.lowest_rows()]

    def is_free(self, rays: Rays, step: float) -> Tensor:
        self._march(RayBatch(rays, step, torch.full((len(rays),), 0.5)))
        return torch.from_numpy(self._rays.counts == 0)

    # ------------------------------------------------------------------------------------------------------ kernels
    def forward(self, batch: RayBatch) -> Tensor:
        """Sums of each ray, [R, N_SUMS], in the order of arrays.RED to ALPHA."""
        self._march(batch)
        samples, ordered, tables = self._samples, self._ordered, self.tables
        total = self._sort_by_place()
        self._harmonics = spherical_harmonics(batch.rays.viewdirs).numpy()
        self._network, self._is_diffuse = tables.network(), batch.is_diffuse
        self._total = total
        share(
            color_samples, total, ordered, samples, tables.values.features, self._harmonics, self._network,
            tables.n_features, tables.n_hidden, batch.is_diffuse,
        )  # fmt: skip
        share(composite, len(batch.rays), self._rays, samples)
        return torch.from_numpy(self._rays.sums)

    def backward(self, gradients: Tensor) -> None:
        """Add up the gradients of tables and network, from those of the last batch's sums [R, N_SUMS]."""
        tables, limits, ordered = self.tables, self._limits, self._ordered
        share(
            ray_gradients, len(gradients), self._rays, self._samples, gradients.contiguous().numpy(), limits.margin,
            limits.unit, np.float32(limits.step * self.field.voxel), self._gradients,
        )  # fmt: skip
        cuts = self._cuts()
        n_slabs = len(cuts) - 1
        sums = Network(*(np.zeros((n_slabs, *part.shape), np.float32) for part in self._network))
        for offset in range(2):  # even slabs share no vertex, nor do odd ones
            share(
                slab_gradients, (n_slabs + 1 - offset) // 2, offset, cuts, ordered, self._gradients,
                self._harmonics, self._network, tables.gradients, tables.touched, sums, tables.n_features,
                tables.n_hidden, self._is_diffuse,
            )  # fmt: skip
        self.tables.show_gradients()
        if not self._is_diffuse:
            first, _, last = self.field.color_network
            w1, b1, w2, b2 = (torch.from_numpy(part.sum(0)) for part in sums)
            for parameter, gradient in ((first.weight, w1.T), (first.bias, b1), (last.weight, w2), (last.bias, b2)):
                parameter.grad = gradient.contiguous() if parameter.grad is None else parameter.grad + gradient

    def _sort_by_place(self) -> int:
        """Order the samples by plane of the grid and part of the plane; returns how many there are."""
        grid, samples, ordered, bins = self.tables.grid, self._samples, self._ordered, self._ordered.bins
        capacity, n_pieces = self._limits.capacity, len(bins)
        pieces = np.arange(n_pieces + 1) * self._n_chunks // n_pieces
        share(count_places, n_pieces, pieces, grid, samples, bins, capacity)
        total = place_bins(len(ordered.planes) - 1, bins, ordered.planes)
        share(put_in_place, n_pieces, pieces, grid, samples, ordered, bins, capacity)
        return total

    def _cuts(self) -> np.ndarray:
        """First sample of each slab, and their number: slabs of whole planes, with about as many samples each."""
        wanted = np.searchsorted(self._ordered.planes, self._total * np.arange(1, SLABS) / SLABS)
        return np.concatenate([[0], self._ordered.planes[np.unique(wanted)], [self._total]])

    def _march(self, batch: RayBatch) -> None:
        n_rays = len(batch.rays)
        self._n_chunks = -(-n_rays // CHUNK)
        observed = np.zeros((0, 3), np.float32) if batch.observed is None else batch.observed.numpy()
        paths = paths_of(self.field.space, self.field.bounds, batch.rays)
        self._rays = new_rays(paths, batch.jitter.numpy(), observed)
        seed = int(self.runtime.randint(2**31 - 1, 1)) if self._limits.russian_roulette else 0
        self._limits = self._limits._replace(seed=seed, step=np.float32(batch.step))
        self._grow(self._limits.capacity)
        while True:
            share(march, self._n_chunks, self.tables.grid, self._rays, self._samples, self._limits)
            if self._samples.counts[: self._n_chunks].max(initial=0) < self._limits.capacity:
                return
            self._grow(self._limits.capacity * 3 // 2)

    def _grow(self, capacity: int) -> None:
        """Memory for `capacity` samples a chunk; it only grows."""
        size = self._n_chunks * capacity
        self._limits = self._limits._replace(capacity=capacity)
        if self._samples is not None and len(self._samples.rays) >= size:
            return
        n_planes = self.field.occupied.shape[0] + 1
        self._samples = new_samples(self._n_chunks, capacity)
        self._gradients = new_sample_gradients(self._samples)
        self._ordered = Sorted(
            np.empty(size, np.int32),
            np.empty((size, 4), np.int32),
            np.empty(size, np.int32),
            np.empty(size, SHARED_PLACE),
            np.empty((size, self.field.n_features), np.float32),
            np.empty((count(), max(1, BINS // n_planes) * n_planes), np.int32),
            np.empty(n_planes + 1, np.int64),
        )


class _Render(torch.autograd.Function):
    """Kernels as an operation of torch. The densities stand for all that is learned, whose gradients take another way."""

    @staticmethod
    def forward(context, densities: Tensor, renderer: FusedRenderer, batch: RayBatch) -> Tensor:
        del densities
        context.renderer = renderer
        return renderer.forward(batch)

    @staticmethod
    def backward(context, gradients: Tensor) -> tuple[None, None, None]:
        context.renderer.backward(gradients)
        return None, None, None


class _Differences(torch.autograd.Function):
    """Squared differences between rows, of densities and of features, [2]."""

    @staticmethod
    def forward(
        context, densities: Tensor, renderer: FusedRenderer, rows: np.ndarray, other_rows: np.ndarray
    ) -> Tensor:
        del densities
        context.renderer, context.pairs = renderer, (rows, other_rows)
        tables = renderer.tables
        sums = np.zeros((-(-len(rows) // BLOCK_PAIRS), 2))
        share(difference_sums, len(sums), rows, other_rows, *tables.values, tables.n_features, sums)
        return torch.from_numpy(sums.sum(0)).float()

    @staticmethod
    def backward(context, gradient: Tensor) -> tuple[None, None, None, None]:
        tables = context.renderer.tables
        density, features = (np.float32(value) for value in gradient.tolist())
        share(
            difference_gradients, len(tables.touched), *context.pairs, tables.values, tables.gradients,
            tables.n_features, tables.touched, density, features,
        )  # fmt: skip
        tables.show_gradients()
        return None, None, None, None
