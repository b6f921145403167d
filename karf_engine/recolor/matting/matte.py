"""A matte: how much of each pixel of a photo one object covers, and what color the object has there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NEGLIGIBLE = 1 / 512  # coverage: less cannot change an 8-bit pixel


@dataclass(frozen=True)
class Matte:
    """One object in one photo. Outside the box the object is not seen; row 0 is on top.

    Attributes:
        rows: First row of the box and the one behind its last, pixels of the photo.
        columns: First column of the box and the one behind its last.
        coverage: [h, w] float16 or float32 in [0, 1], of the box: the share of each pixel that shows the object.
        mixed: [n] int64, running numbers (row by row, in the box) of pixels in which the object's color is known to
            differ from the photo's, because they show something else too; ascending.
        mixed_colors: [n, 3] uint8, the object's own color there, sRGB.
        disputed: Whether photo and field disagree about the object so far that the coverage is the field's.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    coverage: np.ndarray
    mixed: np.ndarray
    mixed_colors: np.ndarray
    disputed: bool = False

    def colors(self, photo: np.ndarray, top: int, bottom: int) -> np.ndarray:
        """The object's own colors in some rows of its box.

        Args:
            photo: The photo's pixels of these rows and the box's columns, uint8 [bottom - top, w, 3].
            top: First row, counted in the box.
            bottom: The row behind the last, counted in the box.

        Returns:
            uint8 [bottom - top, w, 3]: the photo's pixels, where they are mixed the object's share of the mixture.

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
        """The whole photo, uint8 [H, W, 3], with the object's own colors in its box.

        Examples:
            >>> matte = Matte((0, 1), (1, 2), np.array([[0.5]], np.float16), np.array([0]), np.array([[255, 0, 0]]))
            >>> matte.own_picture(np.zeros((1, 2, 3), np.uint8)).tolist()
            [[[0, 0, 0], [255, 0, 0]]]
        """
        result = photo.copy()
        box = slice(*self.rows), slice(*self.columns)
        result[box] = self.colors(photo[box], 0, self.rows[1] - self.rows[0])
        return result


def disputed_objects(objects: Sequence[str], mattes: Sequence[Matte]) -> tuple[str, ...]:
    """The names of those objects whose mattes are disputed.

    Examples:
        >>> nothing = np.zeros((0, 0), np.float16), np.zeros(0, int), np.zeros((0, 3), np.uint8)
        >>> disputed_objects(["pot", "mug"], [Matte((0, 0), (0, 0), *nothing, own) for own in (False, True)])
        ('mug',)
    """
    return tuple(name for name, matte in zip(objects, mattes, strict=True) if matte.disputed)


def dense_coverage(mattes: Sequence[Matte], shape: tuple[int, int]) -> np.ndarray:
    """Coverages of a whole picture.

    Args:
        mattes: Of K objects.
        shape: Height and width of the picture.

    Returns:
        float32 [K, H, W] in [0, 1].

    Examples:
        >>> matte = Matte((0, 1), (1, 2), np.array([[0.5]], np.float16), np.zeros(0, int), np.zeros((0, 3), np.uint8))
        >>> dense_coverage([matte], (1, 3)).tolist()
        [[[0.0, 0.5, 0.0]]]
    """
    result = np.zeros((len(mattes), *shape), np.float32)
    for matte, coverage in zip(mattes, result, strict=True):
        coverage[slice(*matte.rows), slice(*matte.columns)] = matte.coverage
    return result
