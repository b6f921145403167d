"""Overlapping tiles of large pictures, so that results do not depend on the cuts, and distances of pixels to a mask."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np


@dataclass(frozen=True)
class Tile:
    """A tile of a picture."""

    rows: slice  # with the margin, in the picture
    columns: slice
    inner: tuple[slice, slice]  # rows and columns without the margin, in the tile
    place: tuple[slice, slice]  # the same in the picture

    @property
    def outer(self) -> tuple[slice, slice]:
        return self.rows, self.columns


def tiles(size: tuple[int, int], side: int, margin: int) -> Iterator[Tile]:
    """Yield the tiles of a picture of this size (rows, columns); the last ones may be smaller than `side`."""
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
    """Enlarge planes [C, h, w] bilinearly to a size (rows, columns), in one tile: float32 [C, rows, columns]."""
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


def distance_to(mask: np.ndarray) -> np.ndarray:
    """Return the distance of each pixel to a mask, bool [h, w]: float32, 0 inside; infinite for an empty mask."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
