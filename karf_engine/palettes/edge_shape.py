"""Where an object's paint ends: its edge grown or shrunk (choke), and faded (feather). Numpy alone: Blender does it live.

Lengths are pixels of the photo at its full stored size. A picture that shows the photo smaller or larger scales them by
the ratio of the long sides; one of a new camera by that of its long side to the photos' of the capture.

Naming: coverage [H, W] in [0, 1], how much of each pixel is the object's; `before` any shape was given to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, floor, pi, sin, sqrt

import numpy as np

from ..io.arguments import check_fields, check_number

MOST_CHOKE, MOST_FEATHER = 16.0, 64.0
DIRECTIONS = 16  # in which an edge is moved exactly, between them to 2 % of the way
BLOCK = 256  # pixels along the side of blocks, of which only those with an edge are computed, in a core's cache


@dataclass(frozen=True)
class EdgeShape:
    """How an object's edge is moved and faded.

    Attributes:
        choke: Pixels by which the edge moves inwards, from -MOST_CHOKE to MOST_CHOKE; below 0 the object grows.
        feather: Pixels over which the edge then fades, half of them on either side, from 0 to MOST_FEATHER.

    Raises:
        TypeError: A field is no number.
        BadRequest: A number is out of range.

    Examples:
        >>> EdgeShape(choke=-2).is_neutral, EdgeShape().is_neutral
        (False, True)
    """

    choke: float = 0.0
    feather: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        check_number("choke", self.choke, -MOST_CHOKE, MOST_CHOKE)
        check_number("feather", self.feather, 0, MOST_FEATHER)

    @property
    def is_neutral(self) -> bool:
        """Whether it leaves every edge as it is."""
        return not (self.choke or self.feather)

    def reach(self, scale: float) -> int:
        """Pixels, rounded up, beyond an object at most in which this covers something."""
        return ceil(scale * (max(0.0, -self.choke) + self.feather / 2)) + 1


def shaped_edges(edges: Mapping[str, EdgeShape]) -> dict[str, EdgeShape]:
    """Those that are not neutral.

    Examples:
        >>> shaped_edges({"pot": EdgeShape(), "mug": EdgeShape(1.0)})
        {'mug': EdgeShape(choke=1.0, feather=0.0)}
    """
    return {name: shape for name, shape in edges.items() if not shape.is_neutral}


def shaped(coverage: np.ndarray, shape: EdgeShape, scale: float = 1.0, room: np.ndarray | None = None) -> np.ndarray:
    """A coverage with its edge moved, then faded.

    Moving is the erosion of a gray picture by a disk (a dilation below 0), so that a soft edge stays as soft as it was;
    fading is two boxes of half the feather along each axis, so that a straight edge has .5 where it was. At the
    picture's own border an object goes on, as if the picture did.

    Args:
        coverage: [H, W] in [0, 1].
        shape: What to do.
        scale: Pixels of this picture for one of the photo at its full size.
        room: [H, W], what other objects leave of each pixel: no edge spreads into theirs. None: all of it.

    Returns:
        [H, W] float32 in [0, 1]; a neutral shape gives the numbers that were there.

    Examples:
        >>> row = np.array([[0, 0, 0, 1, 1, 1, 1, 1]])
        >>> shaped(row, EdgeShape(choke=2))[0].tolist()
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
        >>> print(shaped(row, EdgeShape(feather=4))[0].round(2))
        [0.   0.03 0.25 0.75 0.97 1.   1.   1.  ]
    """
    before = np.asarray(coverage, np.float32)
    if shape.is_neutral:
        return before.copy()
    result = np.zeros_like(before)
    place = grown_box(box_of(before > 0), shape.reach(scale), before.shape)
    if place is None:
        return result
    result[place] = _where_edges_are(before[place], shape, scale)
    if room is not None:
        grown = result > before  # few pixels
        result[grown] = np.minimum(result[grown], np.maximum(before[grown], room[grown]))
    return result


def _where_edges_are(coverage: np.ndarray, shape: EdgeShape, scale: float) -> np.ndarray:
    """A coverage [H, W] moved and faded, in blocks with what can reach into them; flat parts of these stay as they are."""
    reach = ceil(abs(shape.choke) * scale) + ceil(shape.feather * scale / 2) + 4
    padded, result = np.pad(coverage, reach, mode="edge"), coverage.copy()
    for top in range(0, len(coverage), BLOCK):
        for left in range(0, coverage.shape[1], BLOCK):
            block = result[top : top + BLOCK, left : left + BLOCK]
            around = padded[top : top + block.shape[0] + 2 * reach, left : left + block.shape[1] + 2 * reach]
            rows, columns = (_reached(changes, reach) for changes in _changes_in(around))
            if rows.start < rows.stop and columns.start < columns.stop:
                part = around[rows.start : rows.stop + 2 * reach, columns.start : columns.stop + 2 * reach]
                inside = faded(moved(part, shape.choke * scale), shape.feather * scale)
                block[rows, columns] = inside[reach:-reach, reach:-reach]
    return result


def _changes_in(coverage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each row [H] and each column [W] has a pixel that differs from its neighbor, below it or to the right."""
    down, across = coverage[1:] != coverage[:-1], coverage[:, 1:] != coverage[:, :-1]
    rows, columns = across.any(axis=1), down.any(axis=0)
    rows[:-1] |= down.any(axis=1)
    columns[:-1] |= across.any(axis=0)
    return rows, columns


def _reached(changes: np.ndarray, reach: int) -> slice:
    """Which rows (or columns) between two margins so wide are at most as far from one with a change, or its neighbor."""
    places = np.flatnonzero(changes)
    if not len(places):
        return slice(0, 0)
    return slice(max(0, int(places[0]) - 2 * reach), min(len(changes) - 2 * reach, int(places[-1]) + 2))


def moved(coverage: np.ndarray, distance: float) -> np.ndarray:
    """A coverage whose edge moved inwards by a distance in pixels, below 0 outwards: eroded, or dilated, by a disk.

    Of the disk count its pixels, and DIRECTIONS points of its rim between pixels.

    Examples:
        >>> moved(np.array([[0, 0, 1, 1, 1, 1]], np.float32), 1.5)[0].tolist()
        [0.0, 0.0, 0.0, 0.5, 1.0, 1.0]
    """
    if distance < 0:
        return 1 - moved(1 - coverage, -distance)
    if not distance:
        return coverage
    margin = floor(distance) + 1
    padded = np.pad(coverage, margin, mode="edge")
    height, width = coverage.shape

    def rows(by: int) -> np.ndarray:
        return padded[margin + by : margin + by + height]

    result = coverage.copy()
    # pixels of the disk: rows from its rim inwards, whose parts get longer
    half, wide = 0, padded.copy()
    for by in range(floor(distance), -1, -1):
        while half < floor(sqrt(distance**2 - by**2)):
            half += 1
            np.minimum(wide[:, half:], padded[:, :-half], out=wide[:, half:])
            np.minimum(wide[:, :-half], padded[:, half:], out=wide[:, :-half])
        for side in {by, -by}:
            np.minimum(result, wide[margin + side : margin + side + height, margin : margin + width], out=result)
    for down in sorted({round(distance * sin(2 * pi * k / DIRECTIONS), 6) for k in range(DIRECTIONS)}):
        across = sqrt(max(0.0, distance**2 - down**2))
        row = _between(rows(floor(down)), rows(floor(down) + 1), down - floor(down))
        for side in {across, -across}:
            left = margin + floor(side)
            columns = row[:, left : left + width], row[:, left + 1 : left + 1 + width]
            np.minimum(result, _between(*columns, side - floor(side)), out=result)
    return result


def _between(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """A picture between two."""
    if share < 1e-6:
        return first
    result = second - first
    result *= np.float32(share)
    result += first
    return result


def faded(coverage: np.ndarray, width: float) -> np.ndarray:
    """A coverage [H, W] whose edges fade over a width in pixels: two boxes of half of it along each axis.

    Examples:
        >>> print(faded(np.array([[0, 0, 0, 1, 1, 1]], np.float32), 4)[0].round(2))
        [0.   0.03 0.25 0.75 0.97 1.  ]
    """
    if not width:
        return coverage
    for axis in (0, 0, 1, 1):
        coverage = _boxed(coverage, width / 2, axis)
    return np.clip(coverage, 0, 1)


def _boxed(values: np.ndarray, width: float, axis: int) -> np.ndarray:
    """The mean over a width in pixels along an axis; at the border values go on.

    The outermost pixels count in part, so that the variance is width^2 / 12 whatever the width (the extended box filter
    of Gwosdek, Grewenig, Bruhn and Weickert, "Theoretical Foundations of Gaussian Convolution by Extended Box
    Filtering", 2011, Eq. 5).
    """
    variance, reach = width**2 / 12, floor((sqrt(width**2 + 1) - 1) / 2)
    part = (2 * reach + 1) * (3 * variance - reach * (reach + 1)) / (6 * ((reach + 1) ** 2 - variance))
    size, length = 2 * reach + 1, values.shape[axis]
    padded = np.pad(values, [(reach + 1,) * 2 if each == axis else (0, 0) for each in range(2)], mode="edge")

    def part_of(array: np.ndarray, first: int, count: int) -> np.ndarray:
        return array[first : first + count] if axis == 0 else array[:, first : first + count]

    # sums of 1, 2, 4, .. pixels, of which those are taken that make up the size
    total, taken, power, sums = np.zeros_like(values), 0, 1, padded
    while True:
        if size & power:
            total += part_of(sums, 1 + taken, length)
            taken += power
        if taken == size:
            break
        left = sums.shape[axis] - power
        sums, power = part_of(sums, 0, left) + part_of(sums, power, left), 2 * power
    if part > 0:
        total += np.float32(part) * (part_of(padded, 0, length) + part_of(padded, 2 * reach + 2, length))
    total /= np.float32(size + 2 * part)
    return total


def box_of(covered: np.ndarray) -> tuple[slice, slice] | None:
    """Rows and columns of the box round all that is True in [H, W]; None where nothing is.

    Examples:
        >>> box_of(np.array([[False, False, False], [False, True, True]]))
        (slice(1, 2, None), slice(1, 3, None))
    """
    ends = []
    for axis in (1, 0):
        places = np.flatnonzero(covered.any(axis=axis))
        if not len(places):
            return None
        ends.append(slice(int(places[0]), int(places[-1]) + 1))
    return ends[0], ends[1]


def grown_box(box: tuple[slice, slice] | None, by: int, shape: tuple[int, int]) -> tuple[slice, slice] | None:
    """A box of a picture of this shape with so many pixels more on each side, as far as the picture goes.

    Examples:
        >>> grown_box((slice(1, 2), slice(1, 3)), 2, (9, 4))
        (slice(0, 4, None), slice(0, 4, None))
    """
    if box is None:
        return None
    rows, columns = (
        slice(max(0, each.start - by), min(each.stop + by, side)) for each, side in zip(box, shape, strict=True)
    )
    return rows, columns
