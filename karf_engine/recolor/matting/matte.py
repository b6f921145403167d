"""A matte: an object's coverage of each pixel of a photo, and its unmixed colors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...palettes.edge_shape import bounding_box

NEGLIGIBLE = 1 / 512  # coverage that cannot change an 8-bit pixel
NO_PIXELS, NO_COLORS = np.zeros(0, np.int64), np.zeros((0, 3), np.uint8)


@dataclass(frozen=True)
class Matte:
    """One object in one photo; coverage is 0 outside its bounding box. Row 0 is on top.

    Attributes:
        rows: Of the box, start and stop in pixels of the photo.
        columns: Of the box, start and stop.
        coverage: [h, w] float16 or float32 in [0, 1], of the box.
        mixed: [n] int64, ascending flat indices in the box of mixed pixels whose foreground color is known.
        mixed_colors: [n, 3] uint8 sRGB, the object's own color there.
        disputed: Whether photo and field disagree so much that the coverage is the field's.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    coverage: np.ndarray
    mixed: np.ndarray
    mixed_colors: np.ndarray
    disputed: bool = False

    def colors(self, photo: np.ndarray, top: int, bottom: int) -> np.ndarray:
        """Return the object's own colors in rows `top` to `bottom` of its box, uint8 [bottom - top, w, 3].

        photo: the photo's pixels of these rows and the box's columns, uint8 [bottom - top, w, 3].

        Examples:
            The second pixel is half red object, half white wall:

            >>> matte = Matte((0, 1), (0, 2), np.array([[1, 0.5]], np.float16), np.array([1]), np.array([[255, 0, 0]]))
            >>> matte.colors(np.array([[[250, 5, 5], [255, 128, 128]]], np.uint8), 0, 1).tolist()
            [[[250, 5, 5], [255, 0, 0]]]
        """
        width = self.columns[1] - self.columns[0]
        first, last = np.searchsorted(self.mixed, (top * width, bottom * width))
        result = photo.copy()
        result.reshape(-1, 3)[self.mixed[first:last] - top * width] = self.mixed_colors[first:last]
        return result

    def own_picture(self, photo: np.ndarray) -> np.ndarray:
        """Return the whole photo, uint8 [H, W, 3], with the object's own colors in its box."""
        result = photo.copy()
        box = slice(*self.rows), slice(*self.columns)
        result[box] = self.colors(photo[box], 0, self.rows[1] - self.rows[0])
        return result


def disputed_objects(objects: Sequence[str], mattes: Sequence[Matte]) -> tuple[str, ...]:
    """Return the names of the objects whose mattes are disputed."""
    return tuple(name for name, matte in zip(objects, mattes, strict=True) if matte.disputed)


def dense_coverage(mattes: Sequence[Matte], shape: tuple[int, int]) -> np.ndarray:
    """Return the coverages of a whole picture of this height and width, float32 [K, H, W] in [0, 1].

    Examples:
        >>> matte = Matte((0, 1), (1, 2), np.array([[0.5]], np.float16), np.zeros(0, int), np.zeros((0, 3), np.uint8))
        >>> dense_coverage([matte], (1, 3)).tolist()
        [[[0.0, 0.5, 0.0]]]
    """
    result = np.zeros((len(mattes), *shape), np.float32)
    for matte, coverage in zip(mattes, result, strict=True):
        coverage[slice(*matte.rows), slice(*matte.columns)] = matte.coverage
    return result


def cropped(
    coverage: np.ndarray, dtype: type[np.floating], mixed: np.ndarray = NO_PIXELS, colors: np.ndarray = NO_COLORS
) -> Matte:
    """Crop the coverage [H, W] of a whole photo to a matte. mixed: flat indices [n] in the photo; colors: [n, 3]."""
    box = bounding_box(coverage > NEGLIGIBLE)
    if box is None:
        return Matte((0, 0), (0, 0), np.zeros((0, 0), dtype), NO_PIXELS, NO_COLORS)
    rows, columns = box
    row, column = np.divmod(mixed, coverage.shape[1])
    indices = (row - rows.start) * (columns.stop - columns.start) + column - columns.start
    order = np.argsort(indices)
    inside = coverage[box].astype(dtype)
    return Matte((rows.start, rows.stop), (columns.start, columns.stop), inside, indices[order], colors[order])
