"""Move (choke) and fade (feather) the edge of an object's coverage, in pictures and on points in space.

Lengths are pixels of the photo at its full stored size. Pictures of another size scale them by the ratio of the long
sides; in space a pixel is a length, its footprint at the object. Coverage is [H, W] in [0, 1].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, floor, pi, sqrt

import numpy as np

from ..io.arguments import check_fields, check_number

MAX_CHOKE, MAX_FEATHER = 16.0, 64.0
DIRECTIONS = 16  # of exact erosion; between them the distance is 2 % off at most
CHUNK = 512  # rim evaluations at a time, and
BLOCK = 256  # side of the blocks in pixels: both keep the working set in a core's cache
MAX_EDGE_REACH = MAX_CHOKE + MAX_FEATHER / 2  # pixels that an edge can extend beyond an object


@dataclass(frozen=True)
class EdgeShape:
    """Edge of an object, moved and faded, in pixels of the photo at full size.

    Raises BadRequest if a number is out of range.
    """

    choke: float = 0.0  # inward shift of the edge, -MAX_CHOKE to MAX_CHOKE; negative values grow the object
    feather: float = 0.0  # width of the fade, centered on the moved edge, 0 to MAX_FEATHER

    def __post_init__(self) -> None:
        check_fields(self)
        check_number("choke", self.choke, -MAX_CHOKE, MAX_CHOKE)
        check_number("feather", self.feather, 0, MAX_FEATHER)

    @property
    def is_neutral(self) -> bool:
        return not (self.choke or self.feather)

    def reach(self, scale: float) -> int:
        """Return an upper bound of the pixels that an edge of this shape extends beyond the object."""
        return ceil(scale * (max(0.0, -self.choke) + self.feather / 2)) + 1


def active_edges(edges: Mapping[str, EdgeShape]) -> dict[str, EdgeShape]:
    """Return the edges that are not neutral."""
    return {name: shape for name, shape in edges.items() if not shape.is_neutral}


def apply_edge_shape(
    coverage: np.ndarray, shape: EdgeShape, scale: float = 1.0, room: np.ndarray | None = None
) -> np.ndarray:
    """Return a coverage with its edge moved, then faded, [H, W] float32 in [0, 1].

    Moving is gray-scale erosion (or dilation) by a disk. Fading applies two boxes of half the feather along each axis.
    `scale` is pixels of this picture per pixel of the photo at full size. `room` [H, W], the part of each pixel not
    covered by other objects, limits growth.
    """
    before = np.asarray(coverage, np.float32)
    after = feather(erode(before, shape.choke * scale), shape.feather * scale)
    if room is not None:
        after = np.minimum(after, np.maximum(before, room))
    return before.copy() if after is before else after


def erode(coverage: np.ndarray, distance: float) -> np.ndarray:
    """Erode a coverage by a disk of radius `distance` in pixels, or dilate it if negative.

    The disk is its pixels and DIRECTIONS interpolated points of its rim.
    """
    if not distance:
        return coverage
    radius = abs(distance)
    change = partial(_eroded, radius=radius) if distance > 0 else lambda around: 1 - _eroded(1 - around, radius)
    return _where_edges_are(coverage, _reach_of_disk(radius), change)


def feather(coverage: np.ndarray, width: float) -> np.ndarray:
    """Fade the edges of a coverage [H, W] over a width in pixels."""
    if not width:
        return coverage
    reach = 2 * (_reach_of_box(width / 2) + 1)
    return _where_edges_are(coverage, reach, partial(_boxed_twice, width=width / 2))


def bounding_box(covered: np.ndarray) -> tuple[slice, slice] | None:
    """Return rows and columns of the bounding box of True in [H, W], or None if there is none."""
    ends = []
    for axis in (1, 0):
        places = np.flatnonzero(covered.any(axis=axis))
        if not len(places):
            return None
        ends.append(slice(int(places[0]), int(places[-1]) + 1))
    return ends[0], ends[1]


def dilate_bbox(box: tuple[slice, slice], by: int, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Dilate a box by a number of pixels, clipped to a picture of this shape."""
    rows, columns = (
        slice(max(0, each.start - by), min(each.stop + by, side)) for each, side in zip(box, shape, strict=True)
    )
    return rows, columns


def _where_edges_are(coverage: np.ndarray, reach: int, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Apply an operation, from an array with a margin of `reach` to one without, where a coverage is not constant."""
    result = coverage.copy()
    for top in range(0, coverage.shape[0], BLOCK):
        for left in range(0, coverage.shape[1], BLOCK):
            block = dilate_bbox((slice(top, top + BLOCK), slice(left, left + BLOCK)), 0, coverage.shape)
            around = dilate_bbox(block, reach, coverage.shape)
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
    """Return the box, with a margin of one, outside which [H, W] equals its nearest corners; None if it is constant."""
    first, last = values[0, 0], values[-1, -1]
    box = bounding_box(values != first)
    if box is None:
        return None
    ends = box if first == last else bounding_box(values != last)
    assert ends is not None  # the values are not constant
    rows, columns = (slice(each.start - 1, end.stop + 1) for each, end in zip(box, ends, strict=True))
    return rows, columns


def _with_margin(values: np.ndarray, place: tuple[slice, slice], margin: int) -> np.ndarray:
    """Return a part of [H, W] with a margin on each side, extended by replication."""
    inside = dilate_bbox(place, margin, values.shape)
    beyond = [
        (each.start - own.start + margin, own.stop + margin - each.stop)
        for each, own in zip(inside, place, strict=True)
    ]
    return np.pad(values[inside], beyond, mode="edge") if any(map(any, beyond)) else values[inside]


def _reach_of_disk(radius: float) -> int:
    return floor(radius) + 2


def _eroded(around: np.ndarray, radius: float) -> np.ndarray:
    """Erode by a disk: from [H + 2 reach, W + 2 reach] to [H, W], radius > 0."""
    margin = _reach_of_disk(radius)
    around = np.ascontiguousarray(around)
    # the disk's pixels, for a margin of one: rows from the rim inwards, whose runs get longer
    height, width = len(around) - 2 * margin + 2, around.shape[1] - 2 * margin + 2
    half, wide = 0, around.copy()
    disk = around[margin - 1 : margin - 1 + height, margin - 1 : margin - 1 + width].copy()
    for by in range(floor(radius), -1, -1):
        while half < floor(sqrt(radius**2 - by**2)):
            half += 1
            np.minimum(wide[:, half:], around[:, :-half], out=wide[:, half:])
            np.minimum(wide[:, :-half], around[:, half:], out=wide[:, :-half])
        for side in {by, -by}:
            top = margin - 1 + side
            np.minimum(disk, wide[top : top + height, margin - 1 : margin - 1 + width], out=disk)
    # rim points interpolate pixels of the disk or next to it: they matter only where one of those is smaller
    result = disk[1:-1, 1:-1].copy()
    least = np.minimum(np.minimum(disk[:-2], disk[1:-1]), disk[2:])
    least = np.minimum(np.minimum(least[:, :-2], least[:, 1:-1]), least[:, 2:])
    rows, columns = np.nonzero(least < result)
    pixels = (rows + margin) * around.shape[1] + columns + margin
    for start in range(0, len(pixels), CHUNK):
        chunk = slice(start, start + CHUNK)
        rim = _least_on_rim(around, pixels[chunk], radius)
        places = rows[chunk], columns[chunk]
        result[places] = np.minimum(result[places], rim)
    return result


def _least_on_rim(around: np.ndarray, pixels: np.ndarray, radius: float) -> np.ndarray:
    """Return the least coverage [n] on the rims of disks around pixels [n], given by flat index."""
    angles = 2 * pi * np.arange(DIRECTIONS) / DIRECTIONS
    down, across = np.round(radius * np.sin(angles), 6), np.round(radius * np.cos(angles), 6)
    first = np.floor(down).astype(np.intp) * around.shape[1] + np.floor(across).astype(np.intp)
    corners = np.array([0, 1, around.shape[1], around.shape[1] + 1])  # the pixels around a point
    values = np.take(around, (first + corners[:, None])[..., None] + pixels)
    left, right = _interpolated(values[:2], values[2:], (down % 1)[:, None])
    return _interpolated(left, right, (across % 1)[:, None]).min(axis=0)


def _interpolated(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    result = second - first
    result *= share.astype(np.float32)
    result += first
    return result


def _reach_of_box(width: float) -> int:
    """Return the number of pixels on each side of the center that a box covers wholly."""
    return floor((sqrt(width**2 + 1) - 1) / 2)


def _boxed_twice(around: np.ndarray, width: float) -> np.ndarray:
    """Apply two box filters along each axis; the result is smaller by their margins, and in [0, 1]."""
    for axis in (1, 1, 0, 0):
        around = _boxed(around, width, axis)
    np.maximum(around, 0, out=around)
    return np.minimum(around, 1, out=around)


def _boxed(values: np.ndarray, width: float, axis: int) -> np.ndarray:
    """Apply a box filter along an axis; the result is shorter by its margins."""
    # the outermost pixels count in part, so that the variance is width^2 / 12 for any width (Gwosdek et al.,
    # "Theoretical Foundations of Gaussian Convolution by Extended Box Filtering", 2011, Eq. 5)
    variance, reach = width**2 / 12, _reach_of_box(width)
    part = (2 * reach + 1) * (3 * variance - reach * (reach + 1)) / (6 * ((reach + 1) ** 2 - variance))
    size, length = 2 * reach + 1, values.shape[axis] - 2 * (reach + 1)

    def part_of(array: np.ndarray, first: int, count: int) -> np.ndarray:
        return array[first : first + count] if axis == 0 else array[:, first : first + count]

    total = part_of(values, 0, length) + part_of(values, 2 * reach + 2, length)
    total *= np.float32(max(part, 0))
    # the sum of `size` pixels from sums of 1, 2, 4, ... pixels
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


@dataclass(frozen=True)
class Borders:
    """Signed distances of N points to the borders of K objects, in world units."""

    distances: np.ndarray  # [N, K] float32, positive inside; infinite without a border
    spacings: np.ndarray  # [K] float32, spacing of an object's points
    pixels: np.ndarray  # [K] float32, footprint of a pixel of a full-size photo at an object: median over the photos


def apply_edges_to_points(
    shares: np.ndarray, borders: Borders, objects: Sequence[str], edges: Mapping[str, EdgeShape]
) -> np.ndarray:
    """Return the objects' shares of points, [N, K] in [0, 1], after moving and fading edges, as in pictures."""
    result = np.array(shares, np.float32)
    total = result.sum(axis=1)
    for k, name in enumerate(objects):
        shape = edges.get(name, EdgeShape())
        if not shape.is_neutral:
            before = np.asarray(shares[:, k], np.float32)
            after = _shaped(before, borders.distances[:, k], shape, borders.pixels[k], borders.spacings[k])
            result[:, k] = np.minimum(after, np.maximum(before, 1 - (total - before)))
    return result


def _shaped(share: np.ndarray, distance: np.ndarray, shape: EdgeShape, pixel: float, spacing: float) -> np.ndarray:
    """Return the shares [N] of one object; partial shares move with the edge, within a point's spacing."""
    choke, width = shape.choke * pixel, max(shape.feather * pixel, 1e-6 * spacing)
    place = np.clip((distance - choke) / width, -0.5, 0.5)
    # two boxes, as `feather`
    covered = np.where(place < 0, 2 * (place + 0.5) ** 2, 1 - 2 * (0.5 - place) ** 2).astype(np.float32)
    by = np.clip(choke / spacing, -1, 1)
    inside = (share + (1 - share) * max(0.0, -by)) * covered
    return np.where(distance > 0, inside, np.maximum(covered, share * (1 - max(0.0, by))))
