"""Which vertices of a sparse grid have a row in its tables, and which: one byte a vertex.

Vertices [X+1, Y+1, Z+1] are numbered along z, then y, then x, with room for P >= Z + 2 along z, a multiple of 8. An index
[X+1, Y+1, P / 8] int64 has an entry for every eight of them: the number of rows before these, times 256, plus a bit for
each of the eight that has a row, the lowest for the first. Rows follow the vertices' numbers, so that the upper corner
along z of an occupied cell has the row after the lower one's.
"""

from __future__ import annotations

import torch
from torch import Tensor

BITS = 8  # vertices of an entry


def vertex_index(occupied: Tensor) -> Tensor:
    """The index of the vertices that touch an occupied cell, [X, Y, Z] bool -> [X+1, Y+1, P / 8] int64.

    Example:
        >>> vertex_index(torch.tensor([[[True, False]]])).tolist()  # 4 edges of two vertices each
        [[[3], [515]], [[1027], [1539]]]
    """
    shape = [size + 1 for size in occupied.shape]
    shape[2] += BITS - shape[2] % BITS  # at least one more: the next number after a vertex is never another column's
    touches = torch.zeros(shape, dtype=torch.bool, device=occupied.device)
    x, y, z = occupied.shape
    for corner in range(8):
        i, j, k = corner >> 2 & 1, corner >> 1 & 1, corner & 1
        touches[i : i + x, j : j + y, k : k + z] |= occupied
    eights = touches.view(shape[0], shape[1], shape[2] // BITS, BITS)
    bits = (eights * (1 << torch.arange(BITS, device=occupied.device)).to(torch.uint8)).sum(-1, dtype=torch.uint8)
    counts = eights.sum(-1, dtype=torch.uint8)
    before = torch.cumsum(counts.view(-1), 0, dtype=torch.long).view(counts.shape) - counts
    return before << BITS | bits


def n_rows(index: Tensor) -> int:
    """How many vertices have a row."""
    last = int(index[-1, -1, -1])
    return (last >> BITS) + (last & 0xFF).bit_count()


def numbers_of(index: Tensor) -> Tensor:
    """Number of each row's vertex, [n] int64."""
    bits = (index & 0xFF).to(torch.uint8)
    has_row = (bits[..., None] >> torch.arange(BITS, dtype=torch.uint8, device=index.device)) & 1
    return torch.nonzero(has_row.view(-1)).squeeze(1)


def rows_of(index: Tensor, numbers: Tensor) -> Tensor:
    """Table rows of the vertices with these numbers [..], int64; -1 where one has none."""
    entries, place = index.view(-1)[numbers >> 3], numbers & 7
    below = entries & ((1 << place) - 1)
    below = below - (below >> 1 & 0x55)
    below = (below & 0x33) + (below >> 2 & 0x33)
    rows = (entries >> BITS) + (below + (below >> 4) & 0x0F)
    return torch.where(entries >> place & 1 > 0, rows, -1)
