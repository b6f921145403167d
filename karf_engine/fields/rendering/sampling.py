"""Samples along rays, only where a grid of occupied cells says there may be something.

The grid: an axis-aligned box from `minimum` with cubic cells of size `voxel`, in grid coordinates; `occupied` [X, Y, Z]
bool. Rays are polylines there.
Marching is done in two strides. A coarse one over blocks of `BLOCK` steps throws most of empty space away, a fine one
keeps the samples whose own cell is occupied.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

BLOCK = 4


@dataclass(frozen=True)
class Samples:
    """Packed samples of some rays, in grid coordinates (see space.py).

    Attributes:
        ray_indices: [S], sorted: which ray each sample is of.
        distances: [S], of the intervals' centers from where the ray enters the grid.
        positions: [S, 3].
        step: Length of the intervals, one for all or [S].
    """

    ray_indices: Tensor
    distances: Tensor
    positions: Tensor
    step: float | Tensor

    def __len__(self) -> int:
        return len(self.ray_indices)


def coarse_occupancy(occupied: Tensor) -> Tensor:
    """Blocks of BLOCK^3 cells that hold an occupied cell or touch one within two cells.

    Args:
        occupied: Cells [X, Y, Z] bool.

    Returns:
        Blocks [ceil(X / BLOCK), ceil(Y / BLOCK), ceil(Z / BLOCK)] bool.

    Example:
        >>> occupied = torch.zeros(12, 4, 4, dtype=torch.bool)
        >>> occupied[0, 0, 0] = True
        >>> coarse_occupancy(occupied).flatten()
        tensor([ True, False, False])
    """
    for axis in range(3):
        # a fine sample may lie up to half a coarse stride from the point where the block is looked up
        occupied = spread(occupied, axis, BLOCK // 2)
    rest = [-size % BLOCK for size in occupied.shape]
    padded = torch.nn.functional.pad(occupied, (0, rest[2], 0, rest[1], 0, rest[0]))
    blocks = [size // BLOCK for size in padded.shape]
    return padded.view(blocks[0], BLOCK, blocks[1], BLOCK, blocks[2], BLOCK).any(5).any(3).any(1)


def spread(occupied: Tensor, axis: int, cells: int) -> Tensor:
    """Cells within `cells` of an occupied one along one axis; as bytes, since large grids would fill memory as floats.

    Args:
        occupied: Cells [X, Y, Z] bool.
        axis: 0, 1 or 2.
        cells: How far.

    Returns:
        Cells of the same shape, bool.

    Example:
        >>> spread(torch.tensor([[[True, False, False, False]]]), 2, 2)
        tensor([[[ True,  True,  True, False]]])
    """
    wide, size = occupied.clone(), occupied.shape[axis]
    for distance in range(1, min(cells, size - 1) + 1):
        length = size - distance
        wide.narrow(axis, distance, length).logical_or_(occupied.narrow(axis, 0, length))
        wide.narrow(axis, 0, length).logical_or_(occupied.narrow(axis, distance, length))
    return wide


def cell_indices(positions: Tensor, minimum: Tensor, voxel: float, shape: tuple[int, ...]) -> Tensor:
    """Flat index of the cell that holds each position. Not differentiable.

    Args:
        positions: [.., 3], grid coordinates; those outside take the nearest border cell.
        minimum: [3], lowest corner of the grid.
        voxel: Edge of a cell.
        shape: Number of cells along each axis, (X, Y, Z).

    Returns:
        Indices [..] in [0, X * Y * Z), those of a flattened [X, Y, Z].

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
    """Samples at equal steps inside occupied cells, along polylines. Not differentiable.

    Args:
        paths: Knots [R, K, 3] of each ray's polyline, grid coordinates.
        minimum: [3], lowest corner of the grid.
        voxel: Edge of a cell.
        occupied: Cells [X, Y, Z] bool.
        coarse: `coarse_occupancy(occupied)`.
        step_in_voxels: Distance from sample to sample.
        jitter: [R] in [0, 1), each ray's offset in steps; 0.5 for None.

    Returns:
        The samples of all rays, packed.

    Example:
        >>> occupied = torch.zeros(4, 1, 1, dtype=torch.bool)
        >>> occupied[2] = True
        >>> path = torch.tensor([[[0.0, 0.5, 0.5], [4.0, 0.5, 0.5]]])
        >>> samples = march(path, torch.zeros(3), 1.0, occupied, coarse_occupancy(occupied), 0.5)
        >>> samples.distances
        tensor([2.2500, 2.7500])
    """
    shape = tuple(occupied.shape)
    step = step_in_voxels * voxel
    polylines = Polylines(paths)
    stride = BLOCK * step
    n_strides = int((polylines.lengths.amax() / stride).ceil()) if len(paths) else 0
    if n_strides == 0:
        return _no_samples(paths, step)

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
    if paths.shape[1] > 2:  # bent paths are not clipped to the grid
        maximum = minimum + voxel * torch.tensor(shape, device=minimum.device)
        inside &= ((points >= minimum) & (points < maximum)).all(-1)
    row, column = torch.nonzero(inside, as_tuple=True)
    return Samples(ray_indices[row], distances[row, column], points[row, column], step)


class Polylines:
    """Polylines by the distance travelled along them.

    Attributes:
        lengths: [R], of the whole polylines.

    Example:
        >>> bent = Polylines(torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]]))
        >>> bent.points(torch.tensor([0]), torch.tensor([[0.5, 2.0]]))
        tensor([[[0.5000, 0.0000, 0.0000],
                 [1.0000, 1.0000, 0.0000]]])
    """

    def __init__(self, paths: Tensor) -> None:
        """Measure polylines of knots `paths` [R, K, 3]."""
        pieces = paths[:, 1:] - paths[:, :-1]
        lengths = torch.linalg.norm(pieces, dim=2)
        self._knots = paths
        self._directions = pieces / lengths.clamp_min(1e-12)[..., None]
        self._starts = torch.cumsum(lengths, 1) - lengths
        self.lengths = lengths.sum(1)

    def points(self, rows: Tensor, distances: Tensor) -> Tensor:
        """Points [A, n, 3] at `distances` [A, n] along the paths number `rows` [A]."""
        if self._knots.shape[1] == 2:
            return self._knots[rows, :1] + distances[..., None] * self._directions[rows]
        piece = torch.searchsorted(self._starts[rows], distances.contiguous(), right=True) - 1
        rows = rows[:, None]
        along = distances - self._starts[rows, piece]
        return self._knots[rows, piece] + along[..., None] * self._directions[rows, piece]

    def nearest(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Where each path comes nearest to its point [R, 3]: distance travelled until there, and the gap, [R] each."""
        starts = self._knots[:, :-1]
        ends = torch.cat([self._starts[:, 1:], self.lengths[:, None]], 1)
        along = ((points[:, None] - starts) * self._directions).sum(2).clamp_min(0).minimum(ends - self._starts)
        gaps = torch.linalg.norm(starts + along[..., None] * self._directions - points[:, None], dim=2)
        gap, piece = gaps.min(1, keepdim=True)
        return (self._starts + along).gather(1, piece)[:, 0], gap[:, 0]


def _no_samples(paths: Tensor, step: float) -> Samples:
    device = paths.device
    empty = torch.zeros(0, device=device)
    return Samples(torch.zeros(0, dtype=torch.long, device=device), empty, torch.zeros(0, 3, device=device), step)
