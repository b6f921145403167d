"""A radiance field on a sparse grid of voxels: the default geometry.

Vertices of occupied cells carry one raw density and F prior features; everything between is trilinear. Density is
interpolated raw and activated after, so that a surface can be sharper than a voxel. Color is a sigmoid of the first
three features plus a small network of all features and the viewing direction.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor
from torch.nn.functional import softplus

from ..rendering.rays import Rays
from ..rendering.sampling import Samples, cell_indices, march
from ..rendering.space_values import space_from_json, space_to_json
from ..rendering.spherical_harmonics import spherical_harmonics
from ..rendering.volume import Trace, outward_normals, trace_of
from .grid import VoxelGrid
from .tables import WeightedGather, dilate, rescaled_raw

if TYPE_CHECKING:
    from .fused.frozen import FrozenField

FREEZING = threading.Lock()  # chunks of a picture ask for the same field at once
CORNERS = torch.tensor([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])


class VoxelField(VoxelGrid):
    """Sparse voxels (see grid.py) as a `Field` (see fields/protocol.py). All positions are in grid coordinates."""

    kind = "voxels"

    _frozen: FrozenField | None = None  # what kernels read of it, once they have

    def march(self, rays: Rays, step_in_voxels: float, jitter: Tensor | None = None) -> Samples:
        """Samples of these rays inside occupied cells (see rendering.sampling.march)."""
        return self.march_paths(self.space.paths(rays, *self.bounds), step_in_voxels, jitter)

    def march_paths(self, paths: Tensor, step_in_voxels: float, jitter: Tensor | None = None) -> Samples:
        """Samples along polylines [R, K, 3], likewise."""
        return march(paths, self.minimum, self.voxel, self.occupied, self.coarse, step_in_voxels, jitter)

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Where these rays end."""
        frozen = self._in_kernels()
        if frozen is not None:
            return frozen.trace(rays, step_in_voxels)
        samples = self.march(rays, step_in_voxels)
        sigmas = self.density_at(*self.corners(samples.positions, all_occupied=True))
        return trace_of(samples, sigmas, len(rays))

    def corners(self, positions: Tensor, all_occupied: bool = False) -> tuple[Tensor, Tensor]:
        """Table rows [n, 8] int32 and trilinear weights [n, 8] at positions [n, 3]; a missing vertex has weight 0.

        all_occupied: promises that every position lies in an occupied cell, as marched samples do; none is missing then.
        """
        local = (positions - self.minimum) / self.voxel
        upper = torch.tensor(self.occupied.shape, device=positions.device) - 1
        cell = torch.minimum(local.floor().clamp_min(0), upper.float())
        fraction = local - cell
        offsets = self.vertex_numbers(CORNERS.to(positions.device))
        rows = self.rows_of(self.vertex_numbers(cell.long())[:, None] + offsets).int()
        x, y, z = torch.stack([1 - fraction, fraction], 2).unbind(1)  # [n, 2] each
        weights = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).reshape(-1, 8)
        if all_occupied:
            return rows, weights
        return rows.clamp_min(0), weights * (rows >= 0)

    def density(self, positions: Tensor) -> Tensor:
        """Volume density at positions [n, 3], [n] >= 0 per grid unit; 0 outside occupied cells."""
        inside = self.is_occupied(positions)
        return self.density_at(*self.corners(positions)) * inside

    def density_at(self, rows: Tensor, weights: Tensor) -> Tensor:
        """Density from `corners`, [n]."""
        raw = WeightedGather.apply(self.raw_density, rows, weights)[:, 0]
        return softplus(raw + self.density_bias) / self.voxel

    def features(self, positions: Tensor) -> Tensor:
        """Prior features at positions [n, 3], [n, F], not standardized."""
        frozen = self._in_kernels()
        return self.features_at(*self.corners(positions)) if frozen is None else frozen.features(positions)

    def features_at(self, rows: Tensor, weights: Tensor, diffuse: bool = False) -> Tensor:
        """Prior features from `corners`, [n, F]; only the first three, which hold the diffuse color, for `diffuse`."""
        table = self.feature_table[:, :3].contiguous() if diffuse else self.feature_table
        return WeightedGather.apply(table, rows, weights)

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor, diffuse: bool = False) -> Tensor:
        """sRGB color [n, 3] in (0, 1) seen along viewdirs [n, 3]; `diffuse` leaves the direction out."""
        del positions  # the features hold all that depends on the place
        frozen = None if diffuse else self._in_kernels()
        if frozen is not None:
            return frozen.color(viewdirs, features)
        logits = features[:, :3]
        if not diffuse:
            logits = logits + self.color_network(torch.cat([features, spherical_harmonics(viewdirs)], 1))
        return torch.sigmoid(logits)

    def is_occupied(self, positions: Tensor) -> Tensor:
        """True where a position lies in an occupied cell, [n]."""
        local = (positions - self.minimum) / self.voxel
        upper = torch.tensor(self.occupied.shape, device=positions.device)
        inside = ((local >= 0) & (local < upper)).all(-1)
        return inside & self.occupied.view(-1)[self.cells(positions)]

    def cells(self, positions: Tensor) -> Tensor:
        """Flat cell index of positions, [n]."""
        return cell_indices(positions, self.minimum, self.voxel, tuple(self.occupied.shape))

    def cell_centers(self) -> Tensor:
        """Centers of all occupied cells, [n, 3]."""
        return self.minimum + (torch.nonzero(self.occupied) + 0.5) * self.voxel

    @torch.no_grad()
    def normals(self, positions: Tensor) -> Tensor:
        """Outward surface normals: minus the density's gradient by central differences over one voxel, [n, 3]."""
        return outward_normals(self.density, positions, self.voxel)

    def requires_grad_(self, requires_grad: bool = True) -> VoxelField:
        """Freeze (False) or release all tensors; returns the field. A frozen one must not change until it is released."""
        self._frozen = None
        return super().requires_grad_(requires_grad)

    def _in_kernels(self) -> FrozenField | None:
        """This field for compiled kernels; None where torch computes: while it is learned, and where they do not run."""
        table = self.feature_table
        if table.requires_grad or table.dtype != torch.float32 or not self.suits_kernels:
            return None
        with FREEZING:
            if self._frozen is None:
                from .fused.frozen import FrozenField  # needs numba

                self._frozen = FrozenField(self)
        return self._frozen

    def summary(self) -> dict[str, Any]:
        """Edge of a voxel in grid coordinates, and number of occupied cells."""
        return {"voxel": self.voxel, "cells": int(self.occupied.sum())}

    def config(self) -> dict[str, Any]:
        """JSON values that, beside the tensors, restore the field."""
        return {
            "voxel": self.voxel,
            "n_features": self.n_features,
            "width": self.width,
            "density_bias": self.density_bias,
            "space": space_to_json(self.space),
        }

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> VoxelField:
        """The field of this config and these tensors; in `checkpoints.restoring`, as others may have changed them."""
        # these two as the tensors say, so that no file takes more memory than it fills
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
        """Opacity of one voxel's length at the center of each occupied cell, [n] in [0, 1)."""
        return torch.cat(
            [-torch.expm1(-self.density(points) * self.voxel) for points in self.cell_centers().split(1 << 18)]
        )

    @torch.no_grad()
    def pruned(self, keep: Tensor) -> VoxelField:
        """The same field with only the occupied cells that `keep` [n] names, and those next to them."""
        occupied = torch.zeros_like(self.occupied)
        occupied[self.occupied] = keep
        return self._rebuilt(dilate(occupied) & self.occupied)

    @torch.no_grad()
    def refined(self, voxels_along_longest_side: int, may_hold: Callable[[Tensor], Tensor] | None = None) -> VoxelField:
        """The same field on a finer grid round what is occupied; the physical density is kept.

        may_hold: tells of cells by their centers [n, 3], grid coordinates, which of them to keep, bool [n]; None for all.
        """
        cells = torch.nonzero(self.occupied)
        low = self.minimum + (cells.amin(0) - 1).clamp_min(0) * self.voxel
        high = self.minimum + (cells.amax(0) + 2) * self.voxel
        high = torch.minimum(high, self.bounds[1])
        voxel = float((high - low).max()) / voxels_along_longest_side
        shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
        occupied = self.occupied
        for axis, n in enumerate(shape):  # the coarse cell that each fine one lies in
            centers = low[axis] + (torch.arange(n, device=low.device) + 0.5) * voxel
            parents = ((centers - self.minimum[axis]) / self.voxel).long()
            occupied = occupied.index_select(axis, parents.clamp_max(self.occupied.shape[axis] - 1))
        if may_hold is not None:
            cells = torch.nonzero(occupied)
            occupied[cells.unbind(1)] = may_hold(low + (cells + 0.5) * voxel)
        return self._rebuilt(occupied, low, voxel)

    def _rebuilt(self, occupied: Tensor, minimum: Tensor | None = None, voxel: float | None = None) -> VoxelField:
        same_grid = minimum is None
        field = VoxelField(
            self.minimum if same_grid else minimum,
            self.voxel if same_grid else voxel,
            occupied,
            self.n_features,
            self.width,
            self.density_bias,
            self.space,
        )
        field.color_network.load_state_dict(self.color_network.state_dict())
        tables = field.numbers(), field.raw_density.data, field.feature_table.data
        for numbers, densities, features in zip(*(table.split(1 << 18) for table in tables), strict=True):
            if same_grid:
                rows = self.rows_of(numbers)
                densities.copy_(self.raw_density[rows])
                features.copy_(self.feature_table[rows])
                continue
            rows, weights = self.corners(field.minimum + field.vertices_at(numbers) * field.voxel)
            weights = weights / weights.sum(1, keepdim=True).clamp_min(1e-6)
            raw = WeightedGather.apply(self.raw_density, rows, weights)
            densities.copy_(rescaled_raw(raw, field.voxel / self.voxel, self.density_bias))
            features.copy_(WeightedGather.apply(self.feature_table, rows, weights))
        return field
