"""Update a picture while a swatch is dragged, at the cost of that swatch alone.

Both compositings are linear in the palettes: picture = clip(start + sum_kj planes_kj factors_kj), with shapes as in
`compositing`. The static terms are summed once; each update adds the moving planes within their objects' boxes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .compositing import BLOCK_PIXELS, Planes, hard_masks
from .edge_shape import bounding_box

Entry = tuple[int, int]  # object and palette entry


@dataclass(frozen=True)
class ObjectPlanes:
    """Planes of one object within its bounding box."""

    rows: tuple[int, int]  # the first, and the last plus one
    columns: tuple[int, int]
    planes: np.ndarray  # [M, h, w] float32, each contiguous


class SwatchPicture:
    """Picture of one view, updated in an array.

    `start` [H, W, 3] float32 sRGB does not depend on palettes; `parts` are of the K objects. `out` [H, W, 3] float32 may
    be a view such as rgba[..., :3].
    """

    def __init__(self, start: np.ndarray, parts: Sequence[ObjectPlanes], out: np.ndarray) -> None:
        # contiguous channels: interleaved pixels are several times slower
        self._start = np.ascontiguousarray(start.transpose(2, 0, 1))
        self._parts, self._out = list(parts), out
        self._replaced: list[ObjectPlanes] = []
        self._reshaped: set[int] = set()
        self._retouched: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._factors = np.zeros((len(parts), max((len(part.planes) for part in parts), default=0), 3), np.float32)
        self._moving: list[Entry] = []
        np.clip(start, 0, 1, out=out)

    def paint(self, factors: np.ndarray) -> np.ndarray:
        """Update `out`, [H, W, 3] in [0, 1], to factors [K, M, 3], and return it."""
        factors = np.array(factors, np.float32)
        changed = (factors != self._factors).any(axis=-1)
        if self._retouched:
            self._moving = []  # the static sum may contain retouched planes
            if not changed.any() and not self._reshaped:
                self._paint_retouched()
                return self._out
            self._reshaped |= {k for k, _, _ in self._retouched}
            self._retouched.clear()
        for k in self._reshaped:
            changed[k] |= (factors[k] != 0).any(axis=-1) | (self._factors[k] != 0).any(axis=-1)
        moved = [(int(k), int(j)) for k, j in np.argwhere(changed)]
        parts = [*(self._parts[k] for k, _ in moved), *self._replaced]
        if moved and not (moved == self._moving and self._is_in_box(parts)):
            self._sum_static(moved, parts)
        self._factors = factors
        if moved:
            self._paint_moving()
        self._reshaped.clear()
        self._replaced.clear()
        return self._out

    def reshape(self, k: int, part: ObjectPlanes) -> None:
        """Replace an object's planes, keeping their number, as of the next `paint`."""
        self._replaced.append(self._parts[k])
        self._reshaped.add(k)
        self._parts[k] = part

    def retouch(self, k: int, pixels: np.ndarray, planes: np.ndarray) -> None:
        """Announce new values [M, n] of object k's planes, changed in place at flat indices [n] in its box."""
        self._retouched.append((k, pixels, planes))

    def _paint_retouched(self) -> None:
        """Repaint the retouched pixels with the current factors."""
        for k, pixels, planes in self._retouched:
            part = self._parts[k]
            rows, columns = np.divmod(pixels, part.columns[1] - part.columns[0])
            rows += part.rows[0]
            columns += part.columns[0]
            colors = np.take(self._start.reshape(3, -1), rows * self._start.shape[2] + columns, axis=1)
            for other in map(int, np.flatnonzero(self._factors.any(axis=(1, 2)))):
                if other == k:
                    colors += self._factors[k, : len(planes)].T @ planes
                else:
                    self._add_at(other, rows, columns, colors)
            np.maximum(colors, 0, out=colors)
            np.minimum(colors, 1, out=colors)
            self._out[rows, columns] = colors.T
        self._retouched.clear()

    def _add_at(self, k: int, rows: np.ndarray, columns: np.ndarray, colors: np.ndarray) -> None:
        """Add an object's planes times factors to colors [3, n] of pixels."""
        part = self._parts[k]
        inside = (part.rows[0] <= rows) & (rows < part.rows[1])
        inside &= (part.columns[0] <= columns) & (columns < part.columns[1])
        entries = np.flatnonzero(self._factors[k, : len(part.planes)].any(axis=-1))
        place = rows[inside] - part.rows[0], columns[inside] - part.columns[0]
        planes = np.stack([part.planes[j][place] for j in entries])
        colors[:, inside] += self._factors[k, entries].T @ planes

    def _is_in_box(self, parts: Sequence[ObjectPlanes]) -> bool:
        """Return whether parts are within the box of the moving planes."""
        return all(
            box[0] <= own[0] and own[1] <= box[1]
            for part in parts
            for own, box in ((part.rows, self._rows), (part.columns, self._columns))
        )

    def _sum_static(self, moving: list[Entry], parts: Sequence[ObjectPlanes]) -> None:
        """Sum up the static planes within the box of the moving ones, old and new."""
        self._moving = moving
        self._rows = min(part.rows[0] for part in parts), max(part.rows[1] for part in parts)
        self._columns = min(part.columns[0] for part in parts), max(part.columns[1] for part in parts)
        self._static = self._start[:, slice(*self._rows), slice(*self._columns)].copy()
        edited = {(int(k), int(j)) for k, j in np.argwhere(self._factors.any(axis=-1))}
        static = sorted(edited - set(moving))
        for rows in self._blocks():
            self._add(static, rows, self._static[:, rows.start - self._rows[0] : rows.stop - self._rows[0]])

    def _paint_moving(self) -> None:
        """Write the static sum plus the moving planes, clipped, within the box."""
        for rows in self._blocks():
            block = self._static[:, rows.start - self._rows[0] : rows.stop - self._rows[0]].copy()
            self._add(self._moving, rows, block)
            np.maximum(block, 0, out=block)  # faster than clip
            np.minimum(block, 1, out=block)
            for channel, plane in enumerate(block):
                self._out[rows, slice(*self._columns), channel] = plane

    def _blocks(self) -> Iterator[slice]:
        """Yield the box in blocks of rows whose working set stays in a core's cache."""
        step = max(1, BLOCK_PIXELS // max(1, self._columns[1] - self._columns[0]))
        for top in range(*self._rows, step):
            yield slice(top, min(top + step, self._rows[1]))

    def _add(self, entries: Sequence[Entry], rows: slice, block: np.ndarray) -> None:
        """Add planes times factors to a block [3, h, w] of rows of the box."""
        for k, j in entries:
            part = self._parts[k]
            top, bottom = max(rows.start, part.rows[0]), min(rows.stop, part.rows[1])
            left, right = max(self._columns[0], part.columns[0]), min(self._columns[1], part.columns[1])
            if top >= bottom or left >= right:
                continue
            plane = part.planes[j][_within(part.rows[0], part.columns[0], top, bottom, left, right)]
            place = _within(rows.start, self._columns[0], top, bottom, left, right)
            product = np.empty_like(plane)
            for channel, factor in zip(block, self._factors[k, j], strict=True):
                if factor:
                    np.multiply(plane, factor, out=product)
                    channel[place] += product


def delta_picture(planes: Planes, out: np.ndarray) -> SwatchPicture:
    """Return the picture of `delta_composite`; its factors are edited - learned."""
    parts = [_part(weights) for weights in planes.palette_weights]
    return SwatchPicture(_base(planes), parts, out)


def paper_picture(planes: Planes, out: np.ndarray) -> SwatchPicture:
    """Return the picture of `paper_composite`; its factors are the edited palettes."""
    start, parts = _base(planes), []
    probabilities = planes.probabilities.astype(np.float32)
    for weights, own, mask in zip(planes.palette_weights, probabilities, hard_masks(probabilities), strict=True):
        shares = np.zeros(weights.shape, np.float32)
        np.divide(weights.astype(np.float32), own, out=shares, where=mask)
        parts.append(_part(shares))
        start[mask] = 0
    return SwatchPicture(start, parts, out)


def _base(planes: Planes) -> np.ndarray:
    return planes.base.astype(np.float32) / np.float32(255)


def _part(planes: np.ndarray) -> ObjectPlanes:
    """Crop an object's planes [M, H, W] to the bounding box of nonzero values."""
    rows, columns = bounding_box(np.any(planes, axis=0)) or (slice(0, 0), slice(0, 0))
    cropped = np.ascontiguousarray(planes[:, rows, columns], np.float32)
    return ObjectPlanes((rows.start, rows.stop), (columns.start, columns.stop), cropped)


def _within(first_row: int, first_column: int, top: int, bottom: int, left: int, right: int) -> tuple[slice, slice]:
    return slice(top - first_row, bottom - first_row), slice(left - first_column, right - first_column)
