"""What a voxel field consists of: its cells, and the values that it learns. Torch and kernels compute with them."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...compute.kernels import has_kernels
from ..rendering.sampling import coarse_occupancy
from ..rendering.space import Box, Space
from .vertices import BITS, n_rows, numbers_of, rows_of, vertex_index

MOST_VERTICES = 2**31 - 1  # that kernels can number


class VoxelGrid(nn.Module):
    """Sparse voxels: cells [X, Y, Z], vertices [X+1, Y+1, Z+1].

    minimum: [3] corner of the grid and voxel: cell edge, in grid coordinates; `space` says where they lie in the world
    (a box, whose coordinates are the world's, for None). occupied: [X, Y, Z] bool. density_bias: raw density that stands
    for empty space; alpha of one voxel starts at softplus(bias). `index` says which vertices have a table row (see
    vertices.py).
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
        self.register_buffer("index", vertex_index(occupied), persistent=False)
        self.register_buffer("coarse", coarse_occupancy(occupied), persistent=False)
        n = n_rows(self.index)
        self.raw_density = nn.Parameter(torch.zeros(n, 1, device=minimum.device))
        self.feature_table = nn.Parameter(torch.zeros(n, n_features, device=minimum.device))
        self.color_network = nn.Sequential(nn.Linear(n_features + 9, width), nn.ReLU(), nn.Linear(width, 3)).to(
            minimum.device
        )
        nn.init.zeros_(self.color_network[2].weight)
        nn.init.zeros_(self.color_network[2].bias)

    def vertex_numbers(self, vertices: Tensor) -> Tensor:
        """Numbers of vertices [.., 3] along x, y, z, int64 [..]."""
        _, n_y, n_eights = self.index.shape
        return (vertices[..., 0] * n_y + vertices[..., 1]) * (BITS * n_eights) + vertices[..., 2]

    def vertices_at(self, numbers: Tensor) -> Tensor:
        """Vertices [.., 3] along x, y, z of these numbers [..], int64."""
        _, n_y, n_eights = self.index.shape
        column, z = numbers // (BITS * n_eights), numbers % (BITS * n_eights)
        return torch.stack([column // n_y, column % n_y, z], -1)

    def numbers(self) -> Tensor:
        """Number of each row's vertex, [n] int64."""
        return numbers_of(self.index)

    def rows_of(self, numbers: Tensor) -> Tensor:
        """Table rows of the vertices with these numbers [..], int64; -1 where one has none."""
        return rows_of(self.index, numbers)

    def lowest_rows(self) -> Tensor:
        """Table row of the lowest vertex of each occupied cell, [n] int64."""
        return self.rows_of(self.vertex_numbers(torch.nonzero(self.occupied)))

    @property
    def suits_kernels(self) -> bool:
        """Whether compiled kernels (fused/) run here and can compute this grid."""
        return self.index.device.type == "cpu" and BITS * self.index.numel() <= MOST_VERTICES and has_kernels()

    @property
    def bounds(self) -> Tensor:
        """Minimum and maximum corner, [2, 3]."""
        size = self.voxel * torch.tensor(self.occupied.shape, device=self.minimum.device)
        return torch.stack([self.minimum, self.minimum + size])
