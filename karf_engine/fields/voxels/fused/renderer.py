"""`Renderer` (see ../renderer.py) by compiled kernels, for fields on the processor, and its optimizer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import core_count, limit_torch_threads, parallel_for
from ....compute.kernels import kernel
from ....compute.runtime import Runtime
from ...rendering.rays import Rays, spherical_harmonics
from ...training import Adam
from ..field import VoxelField
from ..renderer import RayBatch, RaySums
from . import arrays
from .arrays import DENSITY, FEATURES, ONE, ZERO, Network, TablePair, flat
from .coloring import bin_offsets, color_samples, composite, count_bins, write_sorted
from .gradients import BLOCK_PAIRS, difference_gradients, difference_sums, ray_gradients, slab_gradients
from .marching import CHUNK, march, mark_visible, paths_of

BINS = 65536  # of the sort by position
SLABS = 24  # of the grid, for parallel gradients
EPSILON = np.float32(1e-12)


class FusedRenderer:
    """`Renderer` whose kernels read the field's parameters in place and write their gradients.

    touched: [n] uint8, flags of each row's gradients since the last step (arrays.DENSITY, arrays.FEATURES).
    """

    def __init__(
        self, field: VoxelField, runtime: Runtime, unit: float, russian_roulette: float, margin: float, off_path: float
    ) -> None:
        """See `new_renderer`."""
        limit_torch_threads()
        self.field, self.runtime = field, runtime
        self.parameters = field.raw_density, field.feature_table
        self.gradients = TablePair(*(np.zeros(table.numel(), np.float32) for table in self.parameters))
        self.touched = np.zeros(len(field.raw_density), np.uint8)
        # numba treats the length of a tuple as a constant
        self.n_features, self._n_hidden = (0,) * field.n_features, (0,) * field.width
        self._grid = arrays.grid_of(field)
        limits = map(np.float32, (russian_roulette, margin, off_path, unit))
        self._settings = arrays.MarchSettings(64 * CHUNK, 0, np.float32(1), *limits)
        self._n_slots = -1  # nothing is allocated
        self._samples: arrays.Samples
        self._ordered: arrays.SortedSamples

    @property
    def tables(self) -> TablePair:
        """Raw densities and features as arrays."""
        return TablePair(*map(flat, self.parameters))

    def _expose_gradients(self) -> None:
        """Set the `grad` of both parameters to the gradients' own memory, which process groups reduce in place."""
        for parameter, gradients in zip(self.parameters, self.gradients, strict=True):
            parameter.grad = torch.from_numpy(gradients).view_as(parameter)

    def optimizer(self, groups: list[dict], betas: tuple[float, float]) -> LazyAdam:
        return LazyAdam(groups, betas, self)

    def render(self, batch: RayBatch) -> RaySums:
        sums = _KernelOperation.apply(self.field.raw_density, lambda: self._forward(batch), self._backward)
        observes, n_samples = torch.from_numpy(self._rays.reach >= 0), int(self._rays.counts.sum())
        final, distortion, before, up_to, distance, square, alpha = sums[:, 3:].unbind(1)
        return RaySums(sums[:, :3], final, distortion, before, up_to, distance, square, alpha, observes, n_samples)

    def differences(self, rows: Tensor, other_rows: Tensor) -> tuple[Tensor, Tensor]:
        pairs = rows.int().numpy(), other_rows.int().numpy()

        def run() -> Tensor:
            sums = np.zeros((-(-len(rows) // BLOCK_PAIRS), 2))
            parallel_for(difference_sums, len(sums), *pairs, *self.tables, self.n_features, sums)
            return torch.from_numpy(sums.sum(0)).float()

        def accumulate(gradient: Tensor) -> None:
            factors = (np.float32(value) for value in gradient.tolist())
            parallel_for(
                difference_gradients, len(self.touched), *pairs, self.tables, self.gradients, self.n_features,
                self.touched, *factors,
            )  # fmt: skip
            self._expose_gradients()

        return _KernelOperation.apply(self.field.raw_density, run, accumulate).unbind(0)

    def visibility(self, batches: Iterable[Rays]) -> Tensor:
        visibility = np.zeros(len(self.field.raw_density), np.float32)
        for rays in batches:
            self._march(RayBatch(rays, 1.0, torch.full((len(rays),), 0.5)))
            mark_visible(self._n_chunks, self._samples, self._settings.capacity, visibility)
        return torch.from_numpy(visibility)[self.field.lowest_rows()]

    def is_free(self, rays: Rays, step: float) -> Tensor:
        self._march(RayBatch(rays, step, torch.full((len(rays),), 0.5)))
        return torch.from_numpy(self._rays.counts == 0)

    def _forward(self, batch: RayBatch) -> Tensor:
        """Return the sums of each ray, [R, 10], in the order of arrays.SUMS."""
        self._march(batch)
        samples, ordered = self._samples, self._ordered
        total = self._sort_by_position()
        self._harmonics = spherical_harmonics(batch.rays.viewdirs).numpy()
        self._network, self._is_diffuse = arrays.network_of(self.field), batch.is_diffuse
        self._total = total
        parallel_for(
            color_samples, total, ordered, samples, self.tables.features, self._harmonics, self._network,
            self.n_features, self._n_hidden, batch.is_diffuse,
        )  # fmt: skip
        parallel_for(composite, len(batch.rays), self._rays, samples)
        return torch.from_numpy(self._rays.sums.view(np.float32).reshape(len(batch.rays), -1))

    def _backward(self, gradients: Tensor) -> None:
        """Accumulate the gradients of tables and network from those of the last batch's sums [R, 10]."""
        settings, upstream = self._settings, gradients.contiguous().numpy().view(arrays.SUMS)[:, 0]
        parallel_for(
            ray_gradients, len(upstream), self._rays, self._samples, upstream, settings.margin, settings.unit,
            np.float32(settings.step * self.field.voxel),
        )  # fmt: skip
        cuts = self._cuts()
        n_slabs = len(cuts) - 1
        sums = Network(*(np.zeros((n_slabs, *part.shape), np.float32) for part in self._network))
        for offset in range(2):  # even slabs share no vertex, neither do odd ones
            parallel_for(
                slab_gradients, (n_slabs + 1 - offset) // 2, offset, cuts, self._ordered, self._samples,
                self._harmonics, self._network, self.gradients, self.touched, sums, self.n_features, self._n_hidden,
                self._is_diffuse,
            )  # fmt: skip
        self._expose_gradients()
        if not self._is_diffuse:
            hidden, output = self.field.color_layers
            w1, b1, w2, b2 = (torch.from_numpy(part.sum(0)) for part in sums)
            parameters = hidden.weight, hidden.bias, output.weight, output.bias
            for parameter, gradient in zip(parameters, (w1.T, b1, w2, b2), strict=True):
                parameter.grad = gradient.contiguous() if parameter.grad is None else parameter.grad + gradient

    def _sort_by_position(self) -> int:
        """Sort the samples by plane of the grid and part of the plane; return their number."""
        grid, samples, ordered, bins = self._grid, self._samples, self._ordered, self._ordered.bins
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
        self._rays = arrays.new_rays(paths, batch.jitter.numpy(), observed)
        seed = int(self.runtime.randint(2**31 - 1, 1)) if self._settings.russian_roulette else 0
        self._settings = self._settings._replace(seed=seed, step=np.float32(batch.step))
        while True:
            self._ensure_slots(self._n_chunks * self._settings.capacity)
            parallel_for(march, self._n_chunks, self._grid, self._rays, self._samples, self._settings)
            if self._samples.counts[: self._n_chunks].max(initial=0) < self._settings.capacity:
                return
            self._settings = self._settings._replace(capacity=self._settings.capacity * 3 // 2)

    def _ensure_slots(self, size: int) -> None:
        if self._n_slots >= size:
            return
        self._n_slots = size
        n_planes = self.field.occupied.shape[0] + 1
        self._samples = arrays.new_samples(self._n_chunks, self._settings.capacity)
        f32, i32 = np.float32, np.int32
        index, corners, rays = np.empty(size, i32), np.empty((size, 4), i32), np.empty(size, i32)
        points, features = np.empty(size, arrays.SORTED_POINT), np.empty((size, self.field.n_features), f32)
        bins = np.empty((core_count(), max(1, BINS // n_planes) * n_planes), i32)
        planes = np.empty(n_planes + 1, np.int64)
        self._ordered = arrays.SortedSamples(index, corners, rays, points, features, bins, planes)


class _KernelOperation(torch.autograd.Function):
    """`run()` as a torch operation, and `accumulate(gradient)` as its backward pass.

    The densities only mark it as differentiable; kernels write the gradients.
    """

    @staticmethod
    def forward(
        context: Any, densities: Tensor, run: Callable[[], Tensor], accumulate: Callable[[Tensor], None]
    ) -> Tensor:
        del densities
        context.accumulate = accumulate
        return run()

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[None, None, None]:
        context.accumulate(gradient)
        return None, None, None


class LazyAdam(Adam):
    """Adam that updates only the table rows touched in an iteration, like `torch.optim.SparseAdam`.

    The first parameter group is the field's tables.
    """

    def __init__(self, groups: list[dict], betas: tuple[float, float], renderer: FusedRenderer) -> None:
        super().__init__(groups, betas=betas, eps=float(EPSILON), fused=True)
        self._renderer = renderer

    @torch.no_grad()
    def step(self, closure: None = None) -> None:
        """Update all parameters with a gradient."""
        renderer, touched = self._renderer, self._renderer.touched
        if renderer.runtime.process_group.size > 1:  # other processes may have touched more rows
            densities, features = renderer.gradients
            touched |= DENSITY * (densities != 0) | FEATURES * (features.reshape(len(densities), -1) != 0).any(1)
        group = self.param_groups[0]
        beta1, beta2 = group["betas"]
        density, features = (self._table(p, g) for p, g in zip(group["params"], renderer.gradients, strict=True))
        count = float(self.state[group["params"][0]]["step"])
        rate = group["lr"] / (1 - beta1**count)
        correction = 1 / math.sqrt(1 - beta2**count)
        parallel_for(
            adam_rows, len(touched), touched, density, features, renderer.n_features,
            *map(np.float32, (rate, beta1, beta2, correction)),
        )  # fmt: skip
        for parameter in group["params"]:
            parameter.grad = None  # excludes the tables from the dense step
        super().step(closure)

    def _table(self, parameter: Tensor, gradients: np.ndarray) -> arrays.Table:
        """Increment the step of a parameter and return its arrays."""
        state = self.state[parameter]
        if not state:
            state["step"] = torch.zeros(())
            state["exp_avg"], state["exp_avg_sq"] = torch.zeros_like(parameter), torch.zeros_like(parameter)
        state["step"] += 1
        return arrays.Table(flat(parameter), gradients, flat(state["exp_avg"]), flat(state["exp_avg_sq"]))


@kernel
def adam_rows(first, last, touched, density, features, n_features, step, beta1, beta2, correction):
    """Update the touched rows first to last.

    step: learning rate / (1 - beta1^t). correction: 1 / sqrt(1 - beta2^t).
    """
    n, start = len(n_features), first  # of a run of rows with gradients of features: long loops become vector code
    for row in range(first, last):
        if touched[row] & DENSITY and density.gradients[row] != ZERO:
            adam_value(density, row, step, beta1, beta2, correction)
        if not touched[row] & FEATURES or not has_gradient(features.gradients, np.uint64(row) * np.uint64(n), n):
            if start < row:
                adam_values(features, start * n, row * n, step, beta1, beta2, correction)
            start = row + 1
        touched[row] = np.uint8(0)
    adam_values(features, start * n, last * n, step, beta1, beta2, correction)


@kernel
def adam_values(table, first, last, step, beta1, beta2, correction):
    """Update the values first to last and reset their gradients."""
    for number in range(first, last):
        adam_value(table, np.uint64(number), step, beta1, beta2, correction)


@kernel
def adam_value(table, k, step, beta1, beta2, correction):
    """Update one value and reset its gradient."""
    gradient = table.gradients[k]
    table.gradients[k] = np.float32(0)
    mean = beta1 * table.means[k] + (ONE - beta1) * gradient
    square = beta2 * table.squares[k] + (ONE - beta2) * gradient * gradient
    table.means[k], table.squares[k] = mean, square
    table.values[k] -= step * mean / (np.float32(math.sqrt(square)) * correction + EPSILON)


@kernel
def has_gradient(gradients, start, n):
    """Return True if any of n values is not 0: all that a process group knows of other processes' rows."""
    for number in range(n):
        if gradients[start + np.uint64(number)] != ZERO:
            return True
    return False
