"""A picture that follows a dragged swatch at the price of that swatch alone, however many others are edited.

Both compositings are linear in the palettes: picture = clip(start + sum_kj planes_kj factors_kj), with naming as in
`compositing`. What does not move is summed once; each further picture adds the planes that move, inside their objects'
boxes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .compositing import BLOCK_PIXELS, Planes, hard_masks

Entry = tuple[int, int]  # object and palette entry


@dataclass(frozen=True)
class Part:
    """One object's planes, inside the box round all of its pixels.

    Attributes:
        rows: First row, and the row behind the last.
        columns: Likewise.
        planes: [M, h, w] float32; each is contiguous.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    planes: np.ndarray


class SwatchPicture:
    """The picture of one view, kept up to date in an array.

    Args:
        start: What does not depend on palettes, [H, W, 3] float32 sRGB.
        parts: Of the K objects.
        out: float32 [H, W, 3], written by `paint` and by nobody else; also a view such as rgba[..., :3].
    """

    def __init__(self, start: np.ndarray, parts: Sequence[Part], out: np.ndarray) -> None:
        # each channel is a contiguous plane: interleaved pixels make every operation several times slower
        self._start = np.ascontiguousarray(start.transpose(2, 0, 1))
        self._parts, self._out = list(parts), out
        self._outgrown: list[Part] = []
        self._reshaped: set[int] = set()
        self._retouched: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._factors = np.zeros((len(parts), max((len(part.planes) for part in parts), default=0), 3), np.float32)
        self._moving: list[Entry] = []
        np.clip(start, 0, 1, out=out)

    def paint(self, factors: np.ndarray) -> np.ndarray:
        """The picture with these factors [K, M, 3]: `out`, [H, W, 3] in [0, 1]."""
        factors = np.array(factors, np.float32)
        changed = (factors != self._factors).any(axis=-1)
        if self._retouched:
            self._moving = []  # what was summed up may hold planes that are others now
            if not changed.any() and not self._reshaped:
                self._paint_retouched()
                return self._out
            self._reshaped |= self._retouched.keys()
            self._retouched.clear()
        for k in self._reshaped:
            changed[k] |= (factors[k] != 0).any(axis=-1) | (self._factors[k] != 0).any(axis=-1)
        moved = [(int(k), int(j)) for k, j in np.argwhere(changed)]
        parts = [*(self._parts[k] for k, _ in moved), *self._outgrown]
        if moved and not (moved == self._moving and self._has_in_box(parts)):
            self._hold(moved, parts)
        self._factors = factors
        if moved:
            self._paint_moving()
        self._reshaped.clear()
        self._outgrown.clear()
        return self._out

    def reshape(self, k: int, part: Part) -> None:
        """Give an object other planes, of as many entries, from the next `paint` on."""
        self._outgrown.append(self._parts[k])
        self._reshaped.add(k)
        self._parts[k] = part

    def retouch(self, k: int, rows: np.ndarray, columns: np.ndarray) -> None:
        """Say that an object's planes have become others, in place, at pixels [n] of the picture: for the next `paint`."""
        if k in self._retouched:
            known = self._retouched[k]
            rows, columns = np.concatenate([known[0], rows]), np.concatenate([known[1], columns])
        self._retouched[k] = rows, columns

    def _paint_retouched(self) -> None:
        """Write the pixels whose planes have become others, with the factors that there are."""
        rows, columns = (np.concatenate(each) for each in zip(*self._retouched.values(), strict=True))
        self._retouched.clear()
        pixels = rows * self._start.shape[2] + columns
        colors = np.take(self._start.reshape(3, -1), pixels, axis=1)
        for k, part in enumerate(self._parts):
            inside = (part.rows[0] <= rows) & (rows < part.rows[1]) & (part.columns[0] <= columns)
            inside &= columns < part.columns[1]
            entries = np.flatnonzero(self._factors[k, : len(part.planes)].any(axis=-1))
            if not (inside.any() and len(entries)):
                continue
            width = part.columns[1] - part.columns[0]
            place = (rows[inside] - part.rows[0]) * width + columns[inside] - part.columns[0]
            planes = np.stack([part.planes[j].ravel()[place] for j in entries])
            colors[:, inside] += self._factors[k, entries].T @ planes
        self._out[rows, columns] = np.clip(colors, 0, 1).T

    def _has_in_box(self, parts: Sequence[Part]) -> bool:
        """Whether parts lie in the box of what moves."""
        return all(
            box[0] <= own[0] and own[1] <= box[1]
            for part in parts
            for own, box in ((part.rows, self._rows), (part.columns, self._columns))
        )

    def _hold(self, moving: list[Entry], parts: Sequence[Part]) -> None:
        """Sum up all that does not move, inside the box of what moves or did."""
        self._moving = moving
        self._rows = min(part.rows[0] for part in parts), max(part.rows[1] for part in parts)
        self._columns = min(part.columns[0] for part in parts), max(part.columns[1] for part in parts)
        self._rest = self._start[:, slice(*self._rows), slice(*self._columns)].copy()
        edited = {(int(k), int(j)) for k, j in np.argwhere(self._factors.any(axis=-1))}
        still = sorted(edited - set(moving))
        for rows in self._blocks():
            self._add(still, rows, self._rest[:, rows.start - self._rows[0] : rows.stop - self._rows[0]])

    def _paint_moving(self) -> None:
        """Write what does not move and what moves, clipped, inside the box."""
        for rows in self._blocks():
            block = self._rest[:, rows.start - self._rows[0] : rows.stop - self._rows[0]].copy()
            self._add(self._moving, rows, block)
            np.maximum(block, 0, out=block)  # these two are faster than clip
            np.minimum(block, 1, out=block)
            for channel, plane in enumerate(block):
                self._out[rows, slice(*self._columns), channel] = plane

    def _blocks(self) -> Iterator[slice]:
        """Rows of the box, in blocks whose working set stays in a core's cache."""
        step = max(1, BLOCK_PIXELS // max(1, self._columns[1] - self._columns[0]))
        for top in range(*self._rows, step):
            yield slice(top, min(top + step, self._rows[1]))

    def _add(self, entries: Sequence[Entry], rows: slice, block: np.ndarray) -> None:
        """Add planes times factors to a block [3, h, w] of these rows of the box."""
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


def photo_plus_change(planes: Planes, out: np.ndarray) -> SwatchPicture:
    """The picture of `delta_composite`; its factors are edited - learned.

    Examples:
        A grey pixel, half of it paint of a swatch that becomes greener:

        >>> weights = np.array([0.5, 0.5], np.float16).reshape(1, 2, 1, 1)
        >>> planes = Planes(("pot",), weights, weights.sum(axis=1), np.full((1, 1, 3), 102, np.uint8))
        >>> picture = photo_plus_change(planes, np.empty((1, 1, 3), np.float32))
        >>> print(picture.paint(np.array([[[0, 0, 0], [-0.2, 0.4, 0]]]))[0, 0].round(3))
        [0.3 0.6 0.4]
    """
    parts = [_part(weights) for weights in planes.palette_weights]
    return SwatchPicture(_base(planes), parts, out)


def palette_only(planes: Planes, out: np.ndarray) -> SwatchPicture:
    """The picture of `paper_composite`; its factors are the edited palettes.

    Examples:
        A pixel of the pot, half black and half a swatch that is green now:

        >>> weights = np.array([0.5, 0.5], np.float16).reshape(1, 2, 1, 1)
        >>> planes = Planes(("pot",), weights, weights.sum(axis=1), np.full((1, 1, 3), 102, np.uint8))
        >>> picture = palette_only(planes, np.empty((1, 1, 3), np.float32))
        >>> print(picture.paint(np.array([[[0, 0, 0], [0.2, 0.8, 0]]]))[0, 0].round(3))
        [0.1 0.4 0. ]
    """
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


def _part(planes: np.ndarray) -> Part:
    """An object's planes [M, H, W] inside the box of all that is not 0."""
    covered = planes.any(axis=0)
    rows, columns = _ends(covered.any(axis=1)), _ends(covered.any(axis=0))
    return Part(rows, columns, np.ascontiguousarray(planes[:, slice(*rows), slice(*columns)], np.float32))


def _within(first_row: int, first_column: int, top: int, bottom: int, left: int, right: int) -> tuple[slice, slice]:
    """Rows and columns of the picture as those of an array that begins at this row and column."""
    return slice(top - first_row, bottom - first_row), slice(left - first_column, right - first_column)


def _ends(hits: np.ndarray) -> tuple[int, int]:
    """The first True, and the place behind the last; equal where there is none."""
    places = np.flatnonzero(hits)
    return (int(places[0]), int(places[-1]) + 1) if len(places) else (0, 0)
