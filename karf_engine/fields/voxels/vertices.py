"""Index from the vertices of a sparse grid to table rows, in one byte per vertex.

Vertices [X+1, Y+1, Z+1] are numbered along z, then y, then x, with P >= Z + 2 numbers along z, a multiple of 8. An index
[X+1, Y+1, P / 8] int64 has one entry per eight vertices: the number of preceding rows times 256, plus one bit for each
vertex with a row, the lowest bit for the first. Rows follow the vertex numbers, so the upper corner of an occupied cell
along z has the row after the lower one's.
"""

from __future__ import annotations

import torch
from torch import Tensor

BITS = 8  # vertices per entry


def vertex_index(occupied: Tensor) -> Tensor:
    """Build the index of all vertices that touch an occupied cell, [X, Y, Z] bool -> [X+1, Y+1, P / 8] int64.

    Example:
        >>> vertex_index(torch.tensor([[[True, False]]])).tolist()  # 4 edges of two vertices each
        [[[3], [515]], [[1027], [1539]]]
    """
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


def n_rows(index: Tensor) -> int:
    """Count the vertices with a row."""
    last = int(index[-1, -1, -1])
    return (last >> BITS) + (last & 0xFF).bit_count()


def numbers_of(index: Tensor) -> Tensor:
    """Return the vertex number of each row, [n] int64."""
    bits = (index & 0xFF).to(torch.uint8)
    has_row = (bits[..., None] >> torch.arange(BITS, dtype=torch.uint8, device=index.device)) & 1
    return torch.nonzero(has_row.view(-1)).squeeze(1)


def rows_of(index: Tensor, numbers: Tensor) -> Tensor:
    """Return the table rows of vertex numbers [..], int64; -1 for vertices without a row."""
    entries, bit = index.view(-1)[numbers >> 3], numbers & 7
    lower_bits = entries & ((1 << bit) - 1)
    # population count of a byte
    n_lower = lower_bits - (lower_bits >> 1 & 0x55)
    n_lower = (n_lower & 0x33) + (n_lower >> 2 & 0x33)
    rows = (entries >> BITS) + (n_lower + (n_lower >> 4) & 0x0F)
    return torch.where(entries >> bit & 1 > 0, rows, -1)
