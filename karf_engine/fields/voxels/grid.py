"""Sparse voxel grid: occupied cells, and table rows for their vertices with the parameters of a radiance field.

Vertices [X+1, Y+1, Z+1] are numbered along z, then y, then x, with P >= Z + 2 numbers along z, a multiple of 8. The index
[X+1, Y+1, P / 8] int64 from numbers to table rows has one entry per eight vertices: the number of preceding rows times
256, plus one bit for each vertex with a row, the lowest bit for the first. Rows follow the vertex numbers, so the upper
corner of an occupied cell along z has the row after the lower one's.
"""

import torch
from torch import Tensor, nn

from ...compute.kernels import has_kernels
from ..rendering.sampling import coarse_occupancy
from ..rendering.space import Box, Space

CORNERS = torch.tensor([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
BITS = 8  # vertices per entry of the index
MAX_VERTICES = 2**31 - 1  # kernels number vertices with int32


class VoxelGrid(nn.Module):
    """Cells and table rows; positions are in the grid coordinates of `space`."""

    minimum: Tensor  # [3], lowest corner of the grid
    occupied: Tensor  # [X, Y, Z] bool
    index: Tensor  # table row of each vertex, see above
    coarse: Tensor  # `sampling.coarse_occupancy` of the cells
    shape: Tensor  # [3], numbers of cells X, Y, Z
    corner_offsets: Tensor  # [8], vertex numbers of a cell's corners less that of its lowest one

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
        self.voxel = float(voxel)  # cell edge
        self.n_features, self.width = n_features, width
        self.density_bias = density_bias  # raw density of empty space
        self.register_buffer("minimum", minimum.float())
        self.register_buffer("occupied", occupied)
        self.register_buffer("index", vertex_index(occupied), persistent=False)
        self.register_buffer("coarse", coarse_occupancy(occupied), persistent=False)
        # made once: copying them to an accelerator waits for it
        self.register_buffer("shape", torch.tensor(occupied.shape, device=minimum.device), persistent=False)
        offsets = self.vertex_numbers(CORNERS.to(minimum.device))
        self.register_buffer("corner_offsets", offsets, persistent=False)
        last, device = int(self.index[-1, -1, -1]), minimum.device
        n = (last >> BITS) + (last & 0xFF).bit_count()
        self.raw_density = nn.Parameter(torch.zeros(n, 1, device=device))  # before bias and softplus
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
        bits = (self.index & 0xFF).to(torch.uint8)
        has_row = (bits[..., None] >> torch.arange(BITS, dtype=torch.uint8, device=bits.device)) & 1
        return torch.nonzero(has_row.view(-1)).squeeze(1)

    def rows_of(self, numbers: Tensor) -> Tensor:
        """Return the table rows of vertex numbers [..], int64; -1 for vertices without a row."""
        entries, bit = self.index.view(-1)[numbers >> 3], numbers & 7
        lower_bits = entries & ((1 << bit) - 1)
        # population count of a byte
        n_lower = lower_bits - (lower_bits >> 1 & 0x55)
        n_lower = (n_lower & 0x33) + (n_lower >> 2 & 0x33)
        rows = (entries >> BITS) + (n_lower + (n_lower >> 4) & 0x0F)
        return torch.where(entries >> bit & 1 > 0, rows, -1)

    def lowest_rows(self) -> Tensor:
        """Return the table row of the lowest vertex of each occupied cell, [n] int64."""
        return self.rows_of(self.vertex_numbers(torch.nonzero(self.occupied)))

    @property
    def suits_kernels(self) -> bool:
        """True if compiled kernels (fused/) run here and can process this grid."""
        return self.index.device.type == "cpu" and BITS * self.index.numel() <= MAX_VERTICES and has_kernels()

    @property
    def bounds(self) -> Tensor:
        """Minimum and maximum corner, [2, 3]."""
        return torch.stack([self.minimum, self.minimum + self.voxel * self.shape])


def vertex_index(occupied: Tensor) -> Tensor:
    """Build the index of all vertices that touch an occupied cell, [X, Y, Z] bool -> [X+1, Y+1, P / 8] int64."""
    shape = [size + 1 for size in occupied.shape]
    shape[2] += BITS - shape[2] % BITS  # pads by at least one, so the number after a vertex is never in another column
    touches = torch.zeros(shape, dtype=torch.bool, device=occupied.device)
    x, y, z = occupied.shape
    for corner in range(8):
        i, j, k = corner >> 2 & 1, corner >> 1 & 1, corner & 1
        touches[i : i + x, j : j + y, k : k + z] |= occupied
    groups = touches.view(shape[0], shape[1], shape[2] // BITS, BITS)
    bits = (groups * (1 << torch.arange(BITS, device=occupied.device)).to(torch.uint8)).sum(-1, dtype=torch.uint8)
    counts = groups.sum(-1, dtype=torch.uint8)
    n_before = torch.cumsum(counts.view(-1), 0, dtype=torch.long).view(counts.shape) - counts
    return n_before << BITS | bits
