"""Radiance field on a sparse voxel grid: the default geometry.

Vertices of occupied cells store one raw density and F prior features, interpolated trilinearly. Softplus is applied
after interpolation (DVGO, Sun et al. 2022), so a surface can be sharper than a voxel. The color is a sigmoid of the
first three features plus the output of a small network of all features and the viewing direction.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor
from torch.nn.functional import embedding_bag, softplus

from ..rendering.rays import Rays, spherical_harmonics
from ..rendering.sampling import Samples, cell_indices, dilate_axis, march
from ..rendering.space import space_from_json, space_to_json
from ..rendering.volume import Trace, make_trace, outward_normals
from .grid import VoxelGrid

if TYPE_CHECKING:
    from .fused.frozen import FrozenField

FREEZE_LOCK = threading.Lock()  # threads render chunks of one picture
CHUNK = 1 << 18  # points processed at once, to limit memory


class WeightedGather(torch.autograd.Function):
    """sum_k weights[:, k] * table[rows[:, k]], differentiable in the table alone."""

    @staticmethod
    def forward(context: Any, table: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
        context.save_for_backward(rows, weights)
        context.n_rows = len(table)
        return embedding_bag(rows, table, per_sample_weights=weights, mode="sum")

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        rows, weights = context.saved_tensors
        n_columns = gradient.shape[1]
        if gradient.device.type == "cpu":  # scattering scalars by column is four times faster than scattering rows
            columns = torch.zeros(n_columns, context.n_rows, dtype=gradient.dtype)
            index = rows.long().view(-1)
            for column in range(n_columns):
                columns[column].scatter_add_(0, index, (gradient[:, column, None] * weights).view(-1))
            return columns.t().contiguous(), None, None
        table_gradient = torch.zeros(context.n_rows, n_columns, dtype=gradient.dtype, device=gradient.device)
        for k in range(8):  # avoids an [n, 8, F] copy
            table_gradient.index_add_(0, rows[:, k], gradient * weights[:, k : k + 1])
        return table_gradient, None, None


class VoxelField(VoxelGrid):
    """`Field` (see fields/protocol.py) on a sparse voxel grid. All positions are in grid coordinates."""

    kind: str = "voxels"

    _frozen: FrozenField | None = None  # copy for compiled kernels, created at the first query

    def march(self, rays: Rays, step_in_voxels: float, jitter: Tensor | None = None) -> Samples:
        """Return samples of rays inside occupied cells (see rendering.sampling.march)."""
        return self.march_paths(self.space.paths(rays, *self.bounds), step_in_voxels, jitter)

    def march_paths(self, paths: Tensor, step_in_voxels: float, jitter: Tensor | None = None) -> Samples:
        """Return samples along polylines [R, K, 3] inside occupied cells."""
        return march(paths, self.minimum, self.voxel, self.occupied, self.coarse, step_in_voxels, jitter)

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Render the ray weights and final transmittance of rays."""
        frozen = self._for_kernels()
        if frozen is not None:
            return frozen.trace(rays, step_in_voxels)
        samples = self.march(rays, step_in_voxels)
        sigmas = self.density_at(*self.corners(samples.positions, all_occupied=True))
        return make_trace(samples, sigmas, len(rays))

    def corners(self, positions: Tensor, all_occupied: bool = False) -> tuple[Tensor, Tensor]:
        """Return table rows [n, 8] int32 and trilinear weights [n, 8] at positions [n, 3].

        all_occupied: all positions are in occupied cells. Otherwise corners without a row get row 0 and weight 0.
        """
        local = (positions - self.minimum) / self.voxel
        cell = torch.minimum(local.floor().clamp_min(0), (self.shape - 1).float())
        fraction = local - cell
        rows = self.rows_of(self.vertex_numbers(cell.long())[:, None] + self.corner_offsets).int()
        x, y, z = torch.stack([1 - fraction, fraction], 2).unbind(1)  # [n, 2] each
        weights = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).reshape(-1, 8)
        if all_occupied:
            return rows, weights
        return rows.clamp_min(0), weights * (rows >= 0)

    def density(self, positions: Tensor) -> Tensor:
        """Return the density [n] >= 0 per grid unit at positions [n, 3]; 0 outside occupied cells."""
        inside = self.is_occupied(positions)
        return self.density_at(*self.corners(positions)) * inside

    def density_at(self, rows: Tensor, weights: Tensor) -> Tensor:
        """Return the density [n] for the result of `corners`."""
        raw = WeightedGather.apply(self.raw_density, rows, weights)[:, 0]
        return softplus(raw + self.density_bias) / self.voxel

    def features(self, positions: Tensor) -> Tensor:
        """Return prior features [n, F] at positions [n, 3], not standardized."""
        frozen = self._for_kernels()
        return self.features_at(*self.corners(positions)) if frozen is None else frozen.features(positions)

    def features_at(self, rows: Tensor, weights: Tensor, diffuse: bool = False) -> Tensor:
        """Return prior features [n, F] for the result of `corners`; with `diffuse` only the three of the diffuse color."""
        table = self.feature_table[:, :3].contiguous() if diffuse else self.feature_table
        return WeightedGather.apply(table, rows, weights)

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor, diffuse: bool = False) -> Tensor:
        """Return the sRGB color [n, 3] in (0, 1) seen along viewdirs [n, 3]; `diffuse` ignores the direction."""
        del positions  # part of the protocol
        frozen = None if diffuse else self._for_kernels()
        if frozen is not None:
            return frozen.color(viewdirs, features)
        logits = features[:, :3]
        if not diffuse:
            logits = logits + self.color_network(torch.cat([features, spherical_harmonics(viewdirs)], 1))
        return torch.sigmoid(logits)

    def is_occupied(self, positions: Tensor) -> Tensor:
        """Return True for positions in occupied cells, [n] bool."""
        local = (positions - self.minimum) / self.voxel
        inside = ((local >= 0) & (local < self.shape)).all(-1)
        return inside & self.occupied.view(-1)[self.cells(positions)]

    def cells(self, positions: Tensor) -> Tensor:
        """Return the flat cell index of positions, [n]."""
        return cell_indices(positions, self.minimum, self.voxel, tuple(self.occupied.shape))

    def cell_centers(self) -> Tensor:
        """Return the centers of all occupied cells, [n, 3]."""
        return self.minimum + (torch.nonzero(self.occupied) + 0.5) * self.voxel

    @torch.no_grad()
    def normals(self, positions: Tensor) -> Tensor:
        """Return outward normals [n, 3]: the negative density gradient by central differences over one voxel."""
        return outward_normals(self.density, positions, self.voxel)

    def requires_grad_(self, requires_grad: bool = True) -> VoxelField:
        """Freeze (False) or unfreeze all parameters. A frozen field must not be modified."""
        self._frozen = None
        return super().requires_grad_(requires_grad)

    def _for_kernels(self) -> FrozenField | None:
        """Return this field for compiled kernels; None if it is not frozen or kernels do not run."""
        table = self.feature_table
        if table.requires_grad or table.dtype != torch.float32 or not self.suits_kernels:
            return None
        with FREEZE_LOCK:
            if self._frozen is None:
                from .fused.frozen import FrozenField  # needs numba

                self._frozen = FrozenField(self)
        return self._frozen

    def summary(self) -> dict[str, Any]:
        """Return the voxel edge in grid coordinates and the number of occupied cells."""
        return {"voxel": self.voxel, "cells": int(self.occupied.sum())}

    def config(self) -> dict[str, Any]:
        """Return the JSON values that restore the field together with its tensors."""
        return {
            "voxel": self.voxel,
            "n_features": self.n_features,
            "width": self.width,
            "density_bias": self.density_bias,
            "space": space_to_json(self.space),
        }

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> VoxelField:
        """Restore a field from untrusted config and tensors, inside `checkpoints.damage_as_data_error`."""
        # sizes from the tensors, so that a file cannot allocate more memory than it contains
        n_features, width = tensors["feature_table"].shape[1], tensors["color_network.0.weight"].shape[0]
        space = space_from_json(config.get("space", {"kind": "box"}), device)
        voxel, density_bias = float(config["voxel"]), float(config["density_bias"])
        if (n_features, width) != (config["n_features"], config["width"]) or voxel <= 0:
            raise ValueError(f"voxels of {voxel}, {n_features} features, width {width}")
        if tensors["occupied"].dtype != torch.bool or tensors["minimum"].shape != (3,):
            raise ValueError("no cells")
        field = cls(tensors["minimum"], voxel, tensors["occupied"], n_features, width, density_bias, space)
        field.load_state_dict(tensors)
        return field

    @torch.no_grad()
    def cell_alphas(self) -> Tensor:
        """Return the opacity of one voxel length at the center of each occupied cell, [n] in [0, 1)."""
        return torch.cat(
            [-torch.expm1(-self.density(points) * self.voxel) for points in self.cell_centers().split(CHUNK)]
        )

    @torch.no_grad()
    def pruned(self, keep: Tensor) -> VoxelField:
        """Return the field without the occupied cells that are neither in `keep` [n] bool nor next to one of them."""
        occupied = torch.zeros_like(self.occupied)
        occupied[self.occupied] = keep
        field = self.with_cells(self.minimum, self.voxel, dilate(occupied) & self.occupied)
        for numbers, densities, features in field._table_chunks():
            rows = self.rows_of(numbers)
            densities.copy_(self.raw_density[rows])
            features.copy_(self.feature_table[rows])
        return field

    @torch.no_grad()
    def refined(self, voxels_along_longest_side: int, keep: Callable[[Tensor], Tensor] | None = None) -> VoxelField:
        """Return the field on a finer grid around the occupied cells, with the same physical density.

        keep: Returns the cells to keep, [n] bool, from their centers [n, 3] in grid coordinates; None keeps all.
        """
        cells = torch.nonzero(self.occupied)
        low = self.minimum + (cells.amin(0) - 1).clamp_min(0) * self.voxel
        high = self.minimum + (cells.amax(0) + 2) * self.voxel
        high = torch.minimum(high, self.bounds[1])
        voxel = float((high - low).max()) / voxels_along_longest_side
        shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
        occupied = self.occupied
        for axis, n in enumerate(shape):  # select the coarse cell around each fine one
            centers = low[axis] + (torch.arange(n, device=low.device) + 0.5) * voxel
            parents = ((centers - self.minimum[axis]) / self.voxel).long()
            occupied = occupied.index_select(axis, parents.clamp_max(self.occupied.shape[axis] - 1))
        if keep is not None:
            cells = torch.nonzero(occupied)
            occupied[cells.unbind(1)] = keep(low + (cells + 0.5) * voxel)
        field = self.with_cells(low, voxel, occupied)
        for numbers, densities, features in field._table_chunks():
            rows, weights = self.corners(field.minimum + field.vertices_at(numbers) * field.voxel)
            weights = weights / weights.sum(1, keepdim=True).clamp_min(1e-6)
            raw = WeightedGather.apply(self.raw_density, rows, weights)
            densities.copy_(rescaled_raw(raw, field.voxel / self.voxel, self.density_bias))
            features.copy_(WeightedGather.apply(self.feature_table, rows, weights))
        return field

    def with_cells(self, minimum: Tensor, voxel: float, occupied: Tensor) -> VoxelField:
        """Return a field on another grid, with the same color network and empty tables."""
        field = VoxelField(minimum, voxel, occupied, self.n_features, self.width, self.density_bias, self.space)
        field.color_network.load_state_dict(self.color_network.state_dict())
        return field

    def _table_chunks(self) -> zip[tuple[Tensor, Tensor, Tensor]]:
        """Split vertex numbers, raw densities and features into chunks of rows."""
        tables = self.numbers(), self.raw_density.data, self.feature_table.data
        return zip(*(table.split(CHUNK) for table in tables), strict=True)


def rescaled_raw(raw: Tensor, ratio: float, bias: float) -> Tensor:
    """Return the raw density that keeps softplus(raw + bias) / voxel when the voxel edge changes by `ratio`."""
    optical_depth = softplus(raw + bias) * ratio
    # inverse softplus: log(expm1(x)) = x + log(-expm1(-x)) neither overflows nor cancels
    return optical_depth + torch.log(-torch.expm1(-optical_depth)) - bias


def dilate(occupied: Tensor) -> Tensor:
    """Dilate occupied cells [X, Y, Z] bool by one cell, diagonals included."""
    for axis in range(3):
        occupied = dilate_axis(occupied, axis, 1)
    return occupied
