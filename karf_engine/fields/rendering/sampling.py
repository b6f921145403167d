"""Sampling of rays: marching through an occupancy grid, and NeRF's hierarchical sampling.

Marching: the grid is an axis-aligned box from `minimum` with cubic cells of edge `voxel`, in grid coordinates;
`occupied` [X, Y, Z] is bool. Rays are polylines there. Empty space is skipped in strides of BLOCK steps, then the
samples in occupied cells are kept.

Hierarchical sampling (NeRF, Sec. 5.2): a coarse pass, then importance sampling of its weights. `t` [R, N], sorted, are
ray parameters; `ray_weights` [R, N] are transmittance times alpha. The formulas are those of the original
implementation (bmild/nerf), so that its checkpoints render alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

BLOCK = 4
LAST_INTERVAL = 1e10  # length of the last interval: any density there absorbs the rest of the light
FLOOR = 1e-5  # added to the weights, so that every interval can be sampled


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
    """Downsample occupied cells [X, Y, Z] to blocks of BLOCK^3, True up to BLOCK / 2 cells from an occupied cell."""
    for axis in range(3):
        # a fine sample is up to half a coarse stride away from the point that selects its block
        occupied = dilate_axis(occupied, axis, BLOCK // 2)
    rest = [-size % BLOCK for size in occupied.shape]
    padded = torch.nn.functional.pad(occupied, (0, rest[2], 0, rest[1], 0, rest[0]))
    blocks = [size // BLOCK for size in padded.shape]
    return padded.view(blocks[0], BLOCK, blocks[1], BLOCK, blocks[2], BLOCK).any(5).any(3).any(1)


def dilate_axis(occupied: Tensor, axis: int, cells: int) -> Tensor:
    """Dilate occupied cells [X, Y, Z] bool along one axis. Works on bytes: large grids would fill memory as floats."""
    wide, size = occupied.clone(), occupied.shape[axis]
    for distance in range(1, min(cells, size - 1) + 1):
        length = size - distance
        wide.narrow(axis, distance, length).logical_or_(occupied.narrow(axis, 0, length))
        wide.narrow(axis, 0, length).logical_or_(occupied.narrow(axis, distance, length))
    return wide


def cell_indices(positions: Tensor, minimum: Tensor, voxel: float, shape: tuple[int, ...]) -> Tensor:
    """Return the flat index of the cell at each position [.., 3], clamped to the border cells."""
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
    """
    shape = tuple(occupied.shape)
    step = step_in_voxels * voxel
    polylines = Polylines(paths)
    stride = BLOCK * step
    if paths.shape[1] == 2:  # a bound instead of their lengths, which an accelerator would have to be waited for
        n_strides = math.ceil(math.hypot(*shape) * voxel / stride) + 1
    else:
        n_strides = int((polylines.lengths.amax() / stride).ceil()) if len(paths) else 0
    if n_strides == 0 or not len(paths):
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
        maximum = minimum + voxel * torch.stack([minimum.new_full((), size) for size in shape])
        inside &= ((points >= minimum) & (points < maximum)).all(-1)
    row, column = torch.nonzero(inside, as_tuple=True)
    return Samples(ray_indices[row], distances[row, column], points[row, column], step)


class Polylines:
    """Polylines [R, K, 3], parametrized by arc length."""

    def __init__(self, paths: Tensor) -> None:
        segments = paths[:, 1:] - paths[:, :-1]
        lengths = torch.linalg.norm(segments, dim=2)
        self._vertices = paths
        self._directions = segments / lengths.clamp_min(1e-12)[..., None]
        self._starts = torch.cumsum(lengths, 1) - lengths
        self.lengths = lengths.sum(1)  # [R]

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


def stratified_samples(near: float, far: float, count: int, in_disparity: bool, jitter: Tensor) -> Tensor:
    """Draw stratified samples t [R, N] along rays, one in each of N = `count` intervals (NeRF, Eq. 2).

    The interval borders are the midpoints of values evenly spaced in t, or in 1 / t where `in_disparity`. `jitter` is
    the position within each interval, [R, N] in [0, 1), or [R, 0] for the evenly spaced values.
    """
    share = torch.linspace(0, 1, count, device=jitter.device)
    even = 1 / ((1 - share) / near + share / far) if in_disparity else near + (far - near) * share
    if not jitter.shape[1]:
        return even.expand(len(jitter), count)
    middles = (even[1:] + even[:-1]) / 2
    lower, upper = torch.cat([even[:1], middles]), torch.cat([middles, even[-1:]])
    return lower + (upper - lower) * jitter


def interval_lengths(t: Tensor) -> Tensor:
    """Return the distance from each sample to the next, [R, N]; LAST_INTERVAL for the last one."""
    return torch.cat([t[:, 1:] - t[:, :-1], torch.full_like(t[:, :1], LAST_INTERVAL)], 1)


def dense_ray_weights(sigmas: Tensor, deltas: Tensor) -> Tensor:
    """Compute ray weights T_i (1 - exp(-sigma_i delta_i)), [R, N] in [0, 1], of N samples per ray (NeRF, Eq. 3).

    Differentiable in densities [R, N] >= 0 and interval lengths [R, N]. See volume.py for packed samples.
    """
    optical_depths = sigmas * deltas
    # an exclusive sum: adding and subtracting the last depth, which may be huge, would cost all digits
    before = torch.cumsum(optical_depths[:, :-1], 1)
    before = torch.cat([torch.zeros_like(before[:, :1]), before], 1)
    return torch.exp(-before) * -torch.expm1(-optical_depths)


def sample_pdf(edges: Tensor, weights: Tensor, u: Tensor) -> Tensor:
    """Invert the distribution function at `u` [R, N] in [0, 1] of a piecewise constant density: samples [R, N].

    It has sorted `edges` [R, M + 1] and unnormalized `weights` [R, M] >= 0, to which FLOOR is added.
    """
    weights = weights + FLOOR
    cdf = torch.cumsum(weights / weights.sum(1, keepdim=True), 1)
    cdf = torch.cat([torch.zeros_like(cdf[:, :1]), cdf], 1)
    upper = torch.searchsorted(cdf, u.contiguous(), right=True)
    below, above = (upper - 1).clamp_min(0), upper.clamp_max(cdf.shape[1] - 1)
    low, high = cdf.gather(1, below), cdf.gather(1, above)
    size = high - low
    share = (u - low) / torch.where(size < FLOOR, torch.ones_like(size), size)
    first = edges.gather(1, below)
    return first + share * (edges.gather(1, above) - first)


def refine(t: Tensor, ray_weights: Tensor, u: Tensor) -> Tensor:
    """Add importance samples of the coarse weights to the coarse samples: t [R, N] to [R, N + F] (NeRF, Sec. 5.2).

    `u` [R, F] in [0, 1] are the arguments of the inverse distribution function.
    """
    middles = (t[:, 1:] + t[:, :-1]) / 2
    return torch.sort(torch.cat([t, sample_pdf(middles, ray_weights[:, 1:-1], u)], 1), 1).values
