"""Ray marching through an occupancy grid.

The grid is an axis-aligned box from `minimum` with cubic cells of edge `voxel`, in grid coordinates; `occupied`
[X, Y, Z] is bool. Rays are polylines there. Marching first skips empty space in strides of BLOCK steps, then keeps the
samples in occupied cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

BLOCK = 4


@dataclass(frozen=True)
class Samples:
    """Packed samples of some rays, in grid coordinates (see space.py)."""

    ray_indices: Tensor  # [S], sorted; maps each sample to its ray
    distances: Tensor  # [S], interval centers, from where the ray enters the grid
    positions: Tensor  # [S, 3]
    step: float | Tensor  # interval length, one for all or [S]

    def __len__(self) -> int:
        return len(self.ray_indices)


def coarse_occupancy(occupied: Tensor) -> Tensor:
    """Downsample occupied cells [X, Y, Z] to blocks of BLOCK^3, True up to BLOCK / 2 cells from an occupied cell.

    Example:
        >>> occupied = torch.zeros(12, 4, 4, dtype=torch.bool)
        >>> occupied[0, 0, 0] = True
        >>> coarse_occupancy(occupied).flatten()
        tensor([ True, False, False])
    """
    for axis in range(3):
        # a fine sample is up to half a coarse stride away from the point that selects its block
        occupied = dilate_axis(occupied, axis, BLOCK // 2)
    rest = [-size % BLOCK for size in occupied.shape]
    padded = torch.nn.functional.pad(occupied, (0, rest[2], 0, rest[1], 0, rest[0]))
    blocks = [size // BLOCK for size in padded.shape]
    return padded.view(blocks[0], BLOCK, blocks[1], BLOCK, blocks[2], BLOCK).any(5).any(3).any(1)


def dilate_axis(occupied: Tensor, axis: int, cells: int) -> Tensor:
    """Dilate occupied cells [X, Y, Z] bool along one axis. Works on bytes: large grids would fill memory as floats.

    Example:
        >>> dilate_axis(torch.tensor([[[True, False, False, False]]]), 2, 2)
        tensor([[[ True,  True,  True, False]]])
    """
    wide, size = occupied.clone(), occupied.shape[axis]
    for distance in range(1, min(cells, size - 1) + 1):
        length = size - distance
        wide.narrow(axis, distance, length).logical_or_(occupied.narrow(axis, 0, length))
        wide.narrow(axis, 0, length).logical_or_(occupied.narrow(axis, distance, length))
    return wide


def cell_indices(positions: Tensor, minimum: Tensor, voxel: float, shape: tuple[int, ...]) -> Tensor:
    """Return the flat index of the cell at each position [.., 3], grid coordinates, of a grid of this shape.

    Positions outside are clamped to border cells. Not differentiable.

    Example:
        >>> cell_indices(torch.tensor([[0.5, 0.5, 1.5], [9.0, 9.0, 9.0]]), torch.zeros(3), 1.0, (2, 2, 2))
        tensor([1, 7])
    """
    cells = ((positions - minimum) / voxel).long()
    x = cells[..., 0].clamp_(0, shape[0] - 1)
    y = cells[..., 1].clamp_(0, shape[1] - 1)
    z = cells[..., 2].clamp_(0, shape[2] - 1)
    return (x * shape[1] + y) * shape[2] + z


def march(
    paths: Tensor,
    minimum: Tensor,
    voxel: float,
    occupied: Tensor,
    coarse: Tensor,
    step_in_voxels: float,
    jitter: Tensor | None = None,
) -> Samples:
    """Sample polylines at equal steps inside occupied cells. Not differentiable.

    Args:
        paths: Polyline vertices [R, K, 3], grid coordinates.
        minimum: [3], lowest corner of the grid.
        voxel: Edge of a cell.
        occupied: Cells [X, Y, Z] bool.
        coarse: `coarse_occupancy(occupied)`.
        step_in_voxels: Step length, voxels.
        jitter: [R] in [0, 1), offset of each ray's samples in steps; 0.5 for None.

    Example:
        >>> occupied = torch.zeros(4, 1, 1, dtype=torch.bool)
        >>> occupied[2] = True
        >>> path = torch.tensor([[[0.0, 0.5, 0.5], [4.0, 0.5, 0.5]]])
        >>> march(path, torch.zeros(3), 1.0, occupied, coarse_occupancy(occupied), 0.5).distances
        tensor([2.2500, 2.7500])
    """
    shape = tuple(occupied.shape)
    step = step_in_voxels * voxel
    polylines = Polylines(paths)
    stride = BLOCK * step
    n_strides = int((polylines.lengths.amax() / stride).ceil()) if len(paths) else 0
    if n_strides == 0:
        empty = paths.new_zeros(0, 3)
        return Samples(torch.zeros(0, dtype=torch.long, device=paths.device), empty[:, 0], empty, step)

    rows = torch.arange(len(paths), device=paths.device)
    middle = ((torch.arange(n_strides, device=paths.device) + 0.5) * stride).expand(len(paths), -1)
    points = polylines.points(rows, middle)
    blocks = cell_indices(points, minimum, voxel * BLOCK, tuple(coarse.shape))
    active = coarse.view(-1)[blocks] & (middle - 0.5 * stride < polylines.lengths[:, None])
    ray_indices, column = torch.nonzero(active, as_tuple=True)

    offset = 0.5 if jitter is None else jitter[ray_indices, None]
    fine = torch.arange(BLOCK, device=paths.device) + offset  # [A, BLOCK]
    distances = column[:, None] * stride + fine * step
    points = polylines.points(ray_indices, distances)
    inside = occupied.view(-1)[cell_indices(points, minimum, voxel, shape)]
    inside &= distances < polylines.lengths[ray_indices, None]
    if paths.shape[1] > 2:  # curved paths are not clipped to the grid
        maximum = minimum + voxel * torch.tensor(shape, device=minimum.device)
        inside &= ((points >= minimum) & (points < maximum)).all(-1)
    row, column = torch.nonzero(inside, as_tuple=True)
    return Samples(ray_indices[row], distances[row, column], points[row, column], step)


class Polylines:
    """Polylines [R, K, 3], parametrized by arc length.

    Attributes:
        lengths: [R], total lengths.

    Example:
        >>> bent = Polylines(torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]]))
        >>> bent.points(torch.tensor([0]), torch.tensor([[0.5, 2.0]]))
        tensor([[[0.5000, 0.0000, 0.0000],
                 [1.0000, 1.0000, 0.0000]]])
    """

    def __init__(self, paths: Tensor) -> None:
        segments = paths[:, 1:] - paths[:, :-1]
        lengths = torch.linalg.norm(segments, dim=2)
        self._vertices = paths
        self._directions = segments / lengths.clamp_min(1e-12)[..., None]
        self._starts = torch.cumsum(lengths, 1) - lengths
        self.lengths = lengths.sum(1)

    def points(self, rows: Tensor, distances: Tensor) -> Tensor:
        """Return the points [A, n, 3] at arc lengths `distances` [A, n] of the polylines `rows` [A]."""
        if self._vertices.shape[1] == 2:
            return self._vertices[rows, :1] + distances[..., None] * self._directions[rows]
        segment = torch.searchsorted(self._starts[rows], distances.contiguous(), right=True) - 1
        rows = rows[:, None]
        along = distances - self._starts[rows, segment]
        return self._vertices[rows, segment] + along[..., None] * self._directions[rows, segment]

    def nearest(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Find the closest point of each polyline to its point [R, 3]: arc length and distance, [R] each."""
        starts = self._vertices[:, :-1]
        ends = torch.cat([self._starts[:, 1:], self.lengths[:, None]], 1)
        along = ((points[:, None] - starts) * self._directions).sum(2).clamp_min(0).minimum(ends - self._starts)
        gaps = torch.linalg.norm(starts + along[..., None] * self._directions - points[:, None], dim=2)
        gap, segment = gaps.min(1, keepdim=True)
        return (self._starts + along).gather(1, segment)[:, 0], gap[:, 0]
