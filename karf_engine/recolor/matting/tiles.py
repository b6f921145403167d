"""Overlapping tiles of large pictures, so that results do not depend on the cuts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np


@dataclass(frozen=True)
class Tile:
    """A tile of a picture.

    Attributes:
        rows: With the margin, in the picture.
        columns: With the margin, in the picture.
        inner: Rows and columns without the margin, in the tile.
        place: Rows and columns without the margin, in the picture.
    """

    rows: slice
    columns: slice
    inner: tuple[slice, slice]
    place: tuple[slice, slice]

    @property
    def outer(self) -> tuple[slice, slice]:
        """Rows and columns with the margin, in the picture."""
        return self.rows, self.columns


def tiles(size: tuple[int, int], side: int, margin: int) -> Iterator[Tile]:
    """Yield the tiles of a picture of this size (rows, columns); the last ones may be smaller than `side`.

    Examples:
        >>> [tile.place[1] for tile in tiles((4, 5), side=4, margin=1)]
        [slice(0, 4, None), slice(4, 5, None)]
    """
    height, width = size
    for top, left in product(range(0, height, side), range(0, width, side)):
        bottom, right = min(height, top + side), min(width, left + side)
        rows = slice(max(0, top - margin), min(height, bottom + margin))
        columns = slice(max(0, left - margin), min(width, right + margin))
        inner = (
            slice(top - rows.start, bottom - rows.start),
            slice(left - columns.start, right - columns.start),
        )
        yield Tile(rows, columns, inner, (slice(top, bottom), slice(left, right)))


def upsample_tile(planes: np.ndarray, size: tuple[int, int], tile: Tile) -> np.ndarray:
    """Enlarge planes [C, h, w] bilinearly to a size (rows, columns), in one tile: float32 [C, rows, columns].

    Examples:
        >>> tile = next(tiles((2, 4), side=4, margin=0))
        >>> upsample_tile(np.array([[[0.0, 1.0]]]), (2, 4), tile)[0, 0].tolist()
        [0.0, 0.25, 0.75, 1.0]
    """
    down, across = planes.shape[1] / size[0], planes.shape[2] / size[1]
    top, left = max(0, int(tile.rows.start * down) - 1), max(0, int(tile.columns.start * across) - 1)
    bottom, right = int(tile.rows.stop * down) + 2, int(tile.columns.stop * across) + 2
    source = planes[:, top:bottom, left:right].astype(np.float32)
    first_row = (tile.rows.start + 0.5) * down - 0.5 - top  # of the tile, in the source; pixel centers are at .5
    first_column = (tile.columns.start + 0.5) * across - 0.5 - left
    to_source = np.array([[across, 0, first_column], [0, down, first_row]])
    shape = (tile.columns.stop - tile.columns.start, tile.rows.stop - tile.rows.start)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.stack(
        [cv2.warpAffine(plane, to_source, shape, flags=flags, borderMode=cv2.BORDER_REPLICATE) for plane in source]
    )
