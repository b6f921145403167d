"""Samples along rays, only where a grid of occupied cells says there may be something.

The grid: an axis-aligned box from `minimum` with cubic cells of size `voxel`; `occupied` [X, Y, Z] bool.
Marching is done in two strides. A coarse one over blocks of `BLOCK` steps throws most of empty space away, a fine one
keeps the samples whose own cell is occupied.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .rays import Rays

BLOCK = 4


@dataclass(frozen=True)
class Samples:
    """Packed samples: ray_indices [S] sorted, distances [S] of the interval centers, positions [S, 3], step length."""

    ray_indices: Tensor
    distances: Tensor
    positions: Tensor
    step: float

    def __len__(self) -> int:
        return len(self.ray_indices)


def intersect_box(rays: Rays, minimum: Tensor, maximum: Tensor) -> tuple[Tensor, Tensor]:
    """Distances at which rays enter and leave a box, [R] each; enter = leave where a ray misses it. Both >= 0."""
    # a zero component would give 0 * inf = nan on a box face
    safe = torch.where(rays.viewdirs.abs() < 1e-9, torch.full_like(rays.viewdirs, 1e-9), rays.viewdirs)
    first = (minimum - rays.origins) / safe
    second = (maximum - rays.origins) / safe
    near = torch.minimum(first, second).amax(1).clamp_min(0)
    far = torch.maximum(first, second).amin(1)
    return near, torch.maximum(near, far)


def coarse_occupancy(occupied: Tensor) -> Tensor:
    """Blocks of BLOCK^3 cells that hold an occupied cell or touch one within two cells, bool."""
    grid = occupied[None, None].float()
    # a fine sample may lie up to half a coarse stride from the point where the block is looked up
    grid = torch.nn.functional.max_pool3d(grid, BLOCK + 1, stride=1, padding=BLOCK // 2)
    return torch.nn.functional.max_pool3d(grid, BLOCK, stride=BLOCK, ceil_mode=True)[0, 0] > 0


def cell_indices(positions: Tensor, minimum: Tensor, voxel: float, shape: tuple[int, ...]) -> Tensor:
    """Flat index of the cell that holds each position [.., 3]; positions outside take the nearest border cell."""
    cells = ((positions - minimum) / voxel).long()
    x = cells[..., 0].clamp_(0, shape[0] - 1)
    y = cells[..., 1].clamp_(0, shape[1] - 1)
    z = cells[..., 2].clamp_(0, shape[2] - 1)
    return (x * shape[1] + y) * shape[2] + z


def march(
    rays: Rays,
    minimum: Tensor,
    voxel: float,
    occupied: Tensor,
    coarse: Tensor,
    step_in_voxels: float,
    jitter: Tensor | None = None,
) -> Samples:
    """Samples at equal steps inside occupied cells.

    coarse: `coarse_occupancy(occupied)`. jitter: [R] in [0, 1), each ray's offset in steps (0.5 for None).
    """
    shape = tuple(occupied.shape)
    step = step_in_voxels * voxel
    maximum = minimum + voxel * torch.tensor(shape, device=minimum.device)
    near, far = intersect_box(rays, minimum, maximum)
    stride = BLOCK * step
    n_strides = int(((far - near).amax() / stride).ceil()) if len(rays) else 0
    if n_strides == 0:
        return _no_samples(rays, step)

    middle = near[:, None] + (torch.arange(n_strides, device=near.device) + 0.5) * stride  # [R, n]
    points = rays.origins[:, None] + middle[..., None] * rays.viewdirs[:, None]
    blocks = cell_indices(points, minimum, voxel * BLOCK, tuple(coarse.shape))
    active = coarse.view(-1)[blocks] & (middle - 0.5 * stride < far[:, None])
    ray_indices, column = torch.nonzero(active, as_tuple=True)

    offset = 0.5 if jitter is None else jitter[ray_indices, None]
    fine = torch.arange(BLOCK, device=near.device) + offset  # [A, BLOCK]
    distances = near[ray_indices, None] + column[:, None] * stride + fine * step
    points = rays.origins[ray_indices, None] + distances[..., None] * rays.viewdirs[ray_indices, None]
    inside = occupied.view(-1)[cell_indices(points, minimum, voxel, shape)] & (distances < far[ray_indices, None])
    row, column = torch.nonzero(inside, as_tuple=True)
    return Samples(ray_indices[row], distances[row, column], points[row, column], step)


def _no_samples(rays: Rays, step: float) -> Samples:
    device = rays.origins.device
    empty = torch.zeros(0, device=device)
    return Samples(torch.zeros(0, dtype=torch.long, device=device), empty, torch.zeros(0, 3, device=device), step)
