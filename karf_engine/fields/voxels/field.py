"""A radiance field on a sparse grid of voxels: the default geometry stage.

Vertices of occupied cells carry one raw density and F prior features; everything between is trilinear. Density is
interpolated raw and activated after, so that a surface can be sharper than a voxel. Color is a sigmoid of the first
three features plus a small network of all features and the viewing direction.

Cells [X, Y, Z], vertices [X+1, Y+1, Z+1]; `vertex_rows` maps a vertex to its table row, -1 where it has none.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import max_pool3d, softplus

from ...rendering.rays import Rays
from ...rendering.sampling import Samples, cell_indices, coarse_occupancy, march
from ...rendering.space import Box, Space, space_from_json, space_to_json
from ...rendering.volume import Trace, outward_normals, trace_of

CORNERS = torch.tensor([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])


class _Gather(torch.autograd.Function):
    """sum_k weights[:, k] * table[rows[:, k]]; the gradient goes to the table alone (positions are data here)."""

    @staticmethod
    def forward(context, table: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
        context.save_for_backward(rows, weights)
        context.n_rows = len(table)
        return nn.functional.embedding_bag(rows, table, per_sample_weights=weights, mode="sum")

    @staticmethod
    def backward(context, gradient: Tensor) -> tuple[Tensor, None, None]:
        rows, weights = context.saved_tensors
        table_gradient = torch.zeros(context.n_rows, gradient.shape[1], dtype=gradient.dtype, device=gradient.device)
        if gradient.shape[1] == 1:  # one long scatter is fastest for scalars
            table_gradient[:, 0].index_add_(0, rows.view(-1), (gradient * weights).view(-1))
        else:  # eight short ones need no [n, 8, F] copy
            for k in range(8):
                table_gradient.index_add_(0, rows[:, k], gradient * weights[:, k : k + 1])
        return table_gradient, None, None


class VoxelField(nn.Module):
    """Sparse voxels behind the field protocol (see scene.py).

    minimum: [3] corner of the grid and voxel: cell edge, in grid coordinates, as are all positions below; `space` says
    where they lie in the world (a box, whose coordinates are the world's, for None). occupied: [X, Y, Z] bool.
    density_bias: raw density that stands for empty space; alpha of one voxel starts at softplus(bias).
    """

    def __init__(
        self,
        minimum: Tensor,
        voxel: float,
        occupied: Tensor,
        n_features: int = 12,
        width: int = 64,
        density_bias: float = -5.5,
        space: Space | None = None,
    ) -> None:
        super().__init__()
        self.space = Box() if space is None else space
        self.voxel = float(voxel)
        self.n_features = n_features
        self.width = width
        self.density_bias = density_bias
        self.register_buffer("minimum", minimum.float())
        self.register_buffer("occupied", occupied)
        self.register_buffer("vertex_rows", _vertex_rows(occupied), persistent=False)
        self.register_buffer("coarse", coarse_occupancy(occupied), persistent=False)
        n_rows = int(self.vertex_rows.max()) + 1
        self.raw_density = nn.Parameter(torch.zeros(n_rows, 1, device=minimum.device))
        self.feature_table = nn.Parameter(torch.zeros(n_rows, n_features, device=minimum.device))
        self.color_network = nn.Sequential(nn.Linear(n_features + 9, width), nn.ReLU(), nn.Linear(width, 3)).to(
            minimum.device
        )
        nn.init.zeros_(self.color_network[2].weight)
        nn.init.zeros_(self.color_network[2].bias)

    @property
    def bounds(self) -> Tensor:
        """Minimum and maximum corner, [2, 3]."""
        size = self.voxel * torch.tensor(self.occupied.shape, device=self.minimum.device)
        return torch.stack([self.minimum, self.minimum + size])

    def march(self, rays: Rays, step_in_voxels: float, jitter: Tensor | None = None) -> Samples:
        """Samples of these rays inside occupied cells (see rendering.sampling.march)."""
        paths = self.space.paths(rays, *self.bounds)
        return march(paths, self.minimum, self.voxel, self.occupied, self.coarse, step_in_voxels, jitter)

    def trace(self, rays: Rays, step_in_voxels: float) -> Trace:
        """Where these rays end."""
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
        ny, nz = self.occupied.shape[1] + 1, self.occupied.shape[2] + 1
        cell = cell.long()
        first = (cell[:, 0] * ny + cell[:, 1]) * nz + cell[:, 2]
        corners = CORNERS.to(positions.device)
        offsets = (corners[:, 0] * ny + corners[:, 1]) * nz + corners[:, 2]
        rows = self.vertex_rows.view(-1)[first[:, None] + offsets]
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
        raw = _Gather.apply(self.raw_density, rows, weights)[:, 0]
        return softplus(raw + self.density_bias) / self.voxel

    def features(self, positions: Tensor) -> Tensor:
        """Prior features at positions [n, 3], [n, F], not standardized."""
        return self.features_at(*self.corners(positions))

    def features_at(self, rows: Tensor, weights: Tensor, diffuse: bool = False) -> Tensor:
        """Prior features from `corners`, [n, F]; only the first three, which hold the diffuse color, for `diffuse`."""
        table = self.feature_table[:, :3].contiguous() if diffuse else self.feature_table
        return _Gather.apply(table, rows, weights)

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor, diffuse: bool = False) -> Tensor:
        """sRGB color [n, 3] in (0, 1) seen along viewdirs [n, 3]; `diffuse` leaves the direction out."""
        del positions  # the features hold all that depends on the place
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

    def figures(self) -> dict[str, Any]:
        """What a report says of the field."""
        return {"voxel": self.voxel, "cells": int(self.occupied.sum())}

    def facts(self) -> dict[str, Any]:
        """JSON values that, beside the tensors, restore the field."""
        return {
            "voxel": self.voxel,
            "n_features": self.n_features,
            "width": self.width,
            "density_bias": self.density_bias,
            "space": space_to_json(self.space),
        }

    @classmethod
    def restored(cls, facts: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> VoxelField:
        """The field that had these facts and tensors; in `checkpoints.restoring`, as others may have changed them."""
        # these two as the tensors say, so that no file takes more memory than it fills
        n_features, width = tensors["feature_table"].shape[1], tensors["color_network.0.weight"].shape[0]
        space = space_from_json(facts.get("space", {"kind": "box"}), device)
        voxel, density_bias = float(facts["voxel"]), float(facts["density_bias"])
        if (n_features, width) != (facts["n_features"], facts["width"]) or voxel <= 0:
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
    def refined(self, voxels_along_longest_side: int) -> VoxelField:
        """The same field on a finer grid round what is occupied; the physical density is kept."""
        cells = torch.nonzero(self.occupied)
        low = self.minimum + (cells.amin(0) - 1).clamp_min(0) * self.voxel
        high = self.minimum + (cells.amax(0) + 2) * self.voxel
        high = torch.minimum(high, self.bounds[1])
        voxel = float((high - low).max()) / voxels_along_longest_side
        shape = [max(1, math.ceil(float(side) / voxel - 1e-3)) for side in high - low]
        grid = torch.stack(torch.meshgrid(*[torch.arange(n, device=low.device) for n in shape], indexing="ij"), -1)
        occupied = torch.cat([self.is_occupied(p) for p in (low + (grid.view(-1, 3) + 0.5) * voxel).split(1 << 20)])
        return self._rebuilt(occupied.view(shape), low, voxel)

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
        has_row = field.vertex_rows >= 0
        vertices = torch.nonzero(has_row)
        rows = field.vertex_rows[has_row].long()
        if same_grid:
            old = self.vertex_rows[has_row].long()
            field.raw_density.data[rows] = self.raw_density.data[old]
            field.feature_table.data[rows] = self.feature_table.data[old]
            return field
        for part, target in zip(vertices.split(1 << 18), rows.split(1 << 18), strict=True):
            corner_rows, weights = self.corners(field.minimum + part * field.voxel)
            weights = weights / weights.sum(1, keepdim=True).clamp_min(1e-6)
            raw = _Gather.apply(self.raw_density, corner_rows, weights)
            field.raw_density.data[target] = rescaled_raw(raw, field.voxel / self.voxel, self.density_bias)
            field.feature_table.data[target] = _Gather.apply(self.feature_table, corner_rows, weights)
        return field


def rescaled_raw(raw: Tensor, ratio: float, bias: float) -> Tensor:
    """Raw density that keeps softplus(raw + bias) / voxel when the voxel changes by `ratio`."""
    optical_depth = softplus(raw + bias) * ratio
    # the inverse of softplus; log(expm1(x)) = x + log(-expm1(-x)) neither overflows nor cancels
    return optical_depth + torch.log(-torch.expm1(-optical_depth)) - bias


def dilate(occupied: Tensor, cells: int = 1) -> Tensor:
    """Occupied cells and all within `cells` of them, [X, Y, Z] bool."""
    return max_pool3d(occupied[None, None].float(), 2 * cells + 1, stride=1, padding=cells)[0, 0] > 0


def _vertex_rows(occupied: Tensor) -> Tensor:
    """Row number of each vertex that touches an occupied cell, else -1; [X+1, Y+1, Z+1] int32."""
    padded = nn.functional.pad(occupied[None, None].float(), (1, 1, 1, 1, 1, 1))
    touches = max_pool3d(padded, 2, stride=1)[0, 0] > 0
    rows = torch.cumsum(touches.view(-1), 0, dtype=torch.int32).view(touches.shape) - 1
    return torch.where(touches, rows, torch.full_like(rows, -1))


def spherical_harmonics(viewdirs: Tensor) -> Tensor:
    """Real spherical harmonics up to degree 2 of unit directions [n, 3], [n, 9]."""
    x, y, z = viewdirs.unbind(1)
    return torch.stack(
        [
            torch.full_like(x, 0.282095),
            0.488603 * y,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * y,
            1.092548 * y * z,
            0.315392 * (3 * z * z - 1),
            1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ],
        1,
    )


class Background(nn.Module):
    """What rays see behind the box, a function of direction alone: [n, 3] sRGB in (0, 1)."""

    def __init__(self, width: int = 32) -> None:
        super().__init__()
        self.network = nn.Sequential(nn.Linear(9 + 18, width), nn.ReLU(), nn.Linear(width, 3))

    def forward(self, viewdirs: Tensor) -> Tensor:
        waves = [f(k * viewdirs) for k in (2.0, 4.0, 8.0) for f in (torch.sin, torch.cos)]
        return torch.sigmoid(self.network(torch.cat([spherical_harmonics(viewdirs), *waves], 1)))
