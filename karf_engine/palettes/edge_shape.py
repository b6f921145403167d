"""Where an object's paint ends: its edge grown or shrunk (choke), and faded (feather). Numpy alone: Blender does it live.

Lengths are pixels of the photo at its full stored size. A picture that shows the photo smaller or larger scales them by
the ratio of the long sides; one of a new camera by that of its long side to the photos' of the capture.

Naming: coverage [H, W] in [0, 1], how much of each pixel is the object's; `before` any shape was given to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import ceil, floor, pi, sqrt

import numpy as np

from ..io.arguments import check_fields, check_number

MOST_CHOKE, MOST_FEATHER = 16.0, 64.0
DIRECTIONS = 16  # in which an edge is moved exactly, between them to 2 % of the way
CHUNK = 512  # pixels whose surroundings are looked at one by one, at a time: in a core's cache
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
    after = faded(moved(before, shape.choke * scale), shape.feather * scale)
    if room is not None:
        after = np.minimum(after, np.maximum(before, room))
    return before.copy() if after is before else after


def _where_edges_are(coverage: np.ndarray, reach: int, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """A coverage [H, W] that is changed where it is not flat within so many pixels.

    Args:
        coverage: It, float32.
        reach: On either side of a pixel, as many as the change looks at.
        change: From a part of it with that margin to this part.
    """
    result = coverage.copy()
    for top in range(0, coverage.shape[0], BLOCK):
        for left in range(0, coverage.shape[1], BLOCK):
            block = grown_box((slice(top, top + BLOCK), slice(left, left + BLOCK)), 0, coverage.shape)
            around = grown_box(block, reach, coverage.shape)
            changing = _changing(coverage[around])
            if changing is None:
                continue
            rows, columns = (
                slice(max(own.start, first.start + each.start - reach), min(own.stop, first.start + each.stop + reach))
                for own, first, each in zip(block, around, changing, strict=True)
            )
            if rows.start < rows.stop and columns.start < columns.stop:
                result[rows, columns] = change(_with_margin(coverage, (rows, columns), reach))
    return result


def _changing(values: np.ndarray) -> tuple[slice, slice] | None:
    """The box in [H, W] beyond which all is as in the corner on that side, and a pixel more; None where all is alike."""
    first, last = values[0, 0], values[-1, -1]
    box = box_of(values != first)
    if box is None:
        return None
    ends = box if first == last else box_of(values != last)
    rows, columns = (slice(each.start - 1, end.stop + 1) for each, end in zip(box, ends, strict=True))
    return rows, columns


def _with_margin(values: np.ndarray, place: tuple[slice, slice], margin: int) -> np.ndarray:
    """A part of [H, W] with a margin on each side; beyond the border values go on."""
    inside = grown_box(place, margin, values.shape)
    beyond = [
        (each.start - own.start + margin, own.stop + margin - each.stop)
        for each, own in zip(inside, place, strict=True)
    ]
    return np.pad(values[inside], beyond, mode="edge") if any(map(any, beyond)) else values[inside]


def moved(coverage: np.ndarray, distance: float) -> np.ndarray:
    """A coverage whose edge moved inwards by a distance in pixels, below 0 outwards: eroded, or dilated, by a disk.

    Of the disk count its pixels, and DIRECTIONS points of its rim between pixels.

    Examples:
        >>> moved(np.array([[0, 0, 1, 1, 1, 1]], np.float32), 1.5)[0].tolist()
        [0.0, 0.0, 0.0, 0.5, 1.0, 1.0]
    """
    if not distance:
        return coverage
    change = _eroded if distance > 0 else _dilated
    return _where_edges_are(coverage, _reach_of_disk(abs(distance)), partial(change, distance=abs(distance)))


def _reach_of_disk(distance: float) -> int:
    """Pixels on either side of one that `_eroded` looks at."""
    return floor(distance) + 2


def _dilated(around: np.ndarray, distance: float) -> np.ndarray:
    """What `_eroded` makes of what is not covered."""
    return 1 - _eroded(1 - around, distance)


def _eroded(around: np.ndarray, distance: float) -> np.ndarray:
    """A coverage [H, W] moved by a distance above 0, from it and what lies around it, [H + 2 reach, W + 2 reach]."""
    margin = _reach_of_disk(distance)
    around = np.ascontiguousarray(around)
    # pixels of the disk, here also of those just outside: rows from its rim inwards, whose parts get longer
    height, width = len(around) - 2 * margin + 2, around.shape[1] - 2 * margin + 2
    half, wide = 0, around.copy()
    disk = around[margin - 1 : margin - 1 + height, margin - 1 : margin - 1 + width].copy()
    for by in range(floor(distance), -1, -1):
        while half < floor(sqrt(distance**2 - by**2)):
            half += 1
            np.minimum(wide[:, half:], around[:, :-half], out=wide[:, half:])
            np.minimum(wide[:, :-half], around[:, half:], out=wide[:, :-half])
        for side in {by, -by}:
            top = margin - 1 + side
            np.minimum(disk, wide[top : top + height, margin - 1 : margin - 1 + width], out=disk)
    # a point of the rim lies between pixels that are in the disk or beside it: where those have no less, nor has the point
    result = disk[1:-1, 1:-1].copy()
    least = np.minimum(np.minimum(disk[:-2], disk[1:-1]), disk[2:])
    least = np.minimum(np.minimum(least[:, :-2], least[:, 1:-1]), least[:, 2:])
    rows, columns = np.nonzero(least < result)
    pixels = (rows + margin) * around.shape[1] + columns + margin
    for start in range(0, len(pixels), CHUNK):
        chunk = slice(start, start + CHUNK)
        rim = _least_on_rim(around, pixels[chunk], distance)
        places = rows[chunk], columns[chunk]
        result[places] = np.minimum(result[places], rim)
    return result


def _least_on_rim(around: np.ndarray, pixels: np.ndarray, distance: float) -> np.ndarray:
    """The least coverage [n] on the rim of disks round pixels [n], which are given by running number."""
    turns = 2 * pi * np.arange(DIRECTIONS) / DIRECTIONS
    down, across = (np.round(distance * each(turns), 6) for each in (np.sin, np.cos))
    first = np.floor(down).astype(np.intp) * around.shape[1] + np.floor(across).astype(np.intp)
    corners = np.array([0, 1, around.shape[1], around.shape[1] + 1])  # of the square of pixels that a point is in
    values = np.take(around, (first + corners[:, None])[..., None] + pixels)
    between = _between(values[:2], values[2:], (down % 1)[:, None])
    return _between(*between, (across % 1)[:, None]).min(axis=0)


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Values between two."""
    result = second - first
    result *= share.astype(np.float32)
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
    reach = 2 * (_reach_of_box(width / 2) + 1)
    return _where_edges_are(coverage, reach, partial(_boxed_twice, width=width / 2))


def _reach_of_box(width: float) -> int:
    """Pixels on either side of a box's middle one that it covers wholly."""
    return floor((sqrt(width**2 + 1) - 1) / 2)


def _boxed_twice(around: np.ndarray, width: float) -> np.ndarray:
    """Two boxes of this width along each axis, which gets shorter by what they look at; in [0, 1]."""
    for axis in (1, 1, 0, 0):
        around = _boxed(around, width, axis)
    np.maximum(around, 0, out=around)
    return np.minimum(around, 1, out=around)


def _boxed(values: np.ndarray, width: float, axis: int) -> np.ndarray:
    """The mean over a width in pixels along an axis, which gets shorter by what the mean looks at on either side.

    The outermost pixels count in part, so that the variance is width^2 / 12 whatever the width (the extended box filter
    of Gwosdek, Grewenig, Bruhn and Weickert, "Theoretical Foundations of Gaussian Convolution by Extended Box
    Filtering", 2011, Eq. 5).
    """
    variance, reach = width**2 / 12, _reach_of_box(width)
    part = (2 * reach + 1) * (3 * variance - reach * (reach + 1)) / (6 * ((reach + 1) ** 2 - variance))
    size, length = 2 * reach + 1, values.shape[axis] - 2 * (reach + 1)

    def part_of(array: np.ndarray, first: int, count: int) -> np.ndarray:
        return array[first : first + count] if axis == 0 else array[:, first : first + count]

    total = part_of(values, 0, length) + part_of(values, 2 * reach + 2, length)
    total *= np.float32(max(part, 0))
    # sums of 1, 2, 4, .. pixels, of which those are taken that make up the size
    taken, power, sums = 0, 1, values
    while True:
        if size & power:
            total += part_of(sums, 1 + taken, length)
            taken += power
        if taken == size:
            break
        left = sums.shape[axis] - power
        sums, power = part_of(sums, 0, left) + part_of(sums, power, left), 2 * power
    total *= np.float32(1 / (size + 2 * max(part, 0)))
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
