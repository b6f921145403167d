"""Sparse voxel grid with the parameters of a radiance field."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...compute.kernels import has_kernels
from ..rendering.sampling import coarse_occupancy
from ..rendering.space import Box, Space
from .vertices import BITS, n_rows, numbers_of, rows_of, vertex_index

MAX_VERTICES = 2**31 - 1  # kernels number vertices with int32


class VoxelGrid(nn.Module):
    """Cells [X, Y, Z] and table rows for the vertices of occupied cells.

    Attributes:
        minimum: [3], lowest corner of the grid, grid coordinates of `space`.
        voxel: Cell edge, grid coordinates.
        occupied: [X, Y, Z] bool.
        index: Table row of each vertex (see vertices.py).
        coarse: `sampling.coarse_occupancy` of the cells.
        raw_density: [n, 1], density before bias and softplus.
        feature_table: [n, F].
        density_bias: Raw density of empty space.
        space: Mapping between world and grid coordinates.
    """

    minimum: Tensor
    occupied: Tensor
    index: Tensor
    coarse: Tensor

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
        """Create a grid with all parameters 0; `space` defaults to `Box`."""
        super().__init__()
        self.space = Box() if space is None else space
        self.voxel = float(voxel)
        self.n_features, self.width, self.density_bias = n_features, width, density_bias
        self.register_buffer("minimum", minimum.float())
        self.register_buffer("occupied", occupied)
        self.register_buffer("index", vertex_index(occupied), persistent=False)
        self.register_buffer("coarse", coarse_occupancy(occupied), persistent=False)
        n, device = n_rows(self.index), minimum.device
        self.raw_density = nn.Parameter(torch.zeros(n, 1, device=device))
        self.feature_table = nn.Parameter(torch.zeros(n, n_features, device=device))
        hidden, output = nn.Linear(n_features + 9, width), nn.Linear(width, 3)
        self.color_network = nn.Sequential(hidden, nn.ReLU(), output).to(device)
        nn.init.zeros_(output.weight)
        nn.init.zeros_(output.bias)

    @property
    def color_layers(self) -> tuple[nn.Linear, nn.Linear]:
        """Hidden and output layer of the color network."""
        hidden, _, output = self.color_network
        assert isinstance(hidden, nn.Linear) and isinstance(output, nn.Linear)
        return hidden, output

    def vertex_numbers(self, vertices: Tensor) -> Tensor:
        """Return the numbers [..] int64 of vertices [.., 3]."""
        _, n_y, n_entries = self.index.shape
        return (vertices[..., 0] * n_y + vertices[..., 1]) * (BITS * n_entries) + vertices[..., 2]

    def vertices_at(self, numbers: Tensor) -> Tensor:
        """Return the vertices [.., 3] int64 with these numbers [..]."""
        _, n_y, n_entries = self.index.shape
        column, z = numbers // (BITS * n_entries), numbers % (BITS * n_entries)
        return torch.stack([column // n_y, column % n_y, z], -1)

    def numbers(self) -> Tensor:
        """Return the vertex number of each table row, [n] int64."""
        return numbers_of(self.index)

    def rows_of(self, numbers: Tensor) -> Tensor:
        """Return the table rows of vertex numbers [..], int64; -1 for vertices without a row."""
        return rows_of(self.index, numbers)

    def lowest_rows(self) -> Tensor:
        """Return the table row of the lowest vertex of each occupied cell, [n] int64."""
        return self.rows_of(self.vertex_numbers(torch.nonzero(self.occupied)))

    @property
    def suits_kernels(self) -> bool:
        """Whether compiled kernels (fused/) run here and can process this grid."""
        return self.index.device.type == "cpu" and BITS * self.index.numel() <= MAX_VERTICES and has_kernels()

    @property
    def bounds(self) -> Tensor:
        """Minimum and maximum corner, [2, 3]."""
        size = self.voxel * torch.tensor(self.occupied.shape, device=self.minimum.device)
        return torch.stack([self.minimum, self.minimum + size])
