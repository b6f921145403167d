"""What a voxel field consists of: its cells, and the values that it learns. Torch and kernels compute with them."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ...rendering.sampling import coarse_occupancy
from ...rendering.space import Box, Space
from .tables import vertex_rows


class VoxelGrid(nn.Module):
    """Sparse voxels: cells [X, Y, Z], vertices [X+1, Y+1, Z+1].

    minimum: [3] corner of the grid and voxel: cell edge, in grid coordinates; `space` says where they lie in the world
    (a box, whose coordinates are the world's, for None). occupied: [X, Y, Z] bool. density_bias: raw density that stands
    for empty space; alpha of one voxel starts at softplus(bias). `vertex_rows` maps a vertex to its table row, -1 where
    it has none.
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
        self.register_buffer("vertex_rows", vertex_rows(occupied), persistent=False)
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
