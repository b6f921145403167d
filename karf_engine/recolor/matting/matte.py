"""Mattes: an object's coverage of each pixel of a photo, and its unmixed colors; moved and faded edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...palettes.edge_shape import EdgeShape, active_edges, apply_edge_shape, bounding_box, dilate_bbox

NEGLIGIBLE = 1 / 512  # coverage that cannot change an 8-bit pixel
NO_PIXELS, NO_COLORS = np.zeros(0, np.int64), np.zeros((0, 3), np.uint8)


@dataclass(frozen=True)
class Matte:
    """One object in one photo; coverage is 0 outside its bounding box."""

    rows: tuple[int, int]  # of the box, start and stop in pixels of the photo
    columns: tuple[int, int]
    coverage: np.ndarray  # [h, w] float16 or float32 in [0, 1], of the box
    mixed: np.ndarray  # [n] int64, ascending flat indices in the box of mixed pixels whose foreground color is known
    mixed_colors: np.ndarray  # [n, 3] uint8 sRGB, the object's own color there
    disputed: bool = False  # photo and field disagree so much that the coverage is the field's

    def colors(self, photo: np.ndarray, top: int, bottom: int) -> np.ndarray:
        """Return the object's own colors in rows `top` to `bottom` of its box, by the photo's, uint8 [h, w, 3]."""
        width = self.columns[1] - self.columns[0]
        first, last = np.searchsorted(self.mixed, (top * width, bottom * width))
        result = photo.copy()
        result.reshape(-1, 3)[self.mixed[first:last] - top * width] = self.mixed_colors[first:last]
        return result

    def coverage_in(self, rows: slice, columns: slice) -> np.ndarray:
        """Return the coverage of a part of the photo, float32 [h, w]."""
        result = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.float32)
        top, bottom = max(rows.start, self.rows[0]), min(rows.stop, self.rows[1])
        left, right = max(columns.start, self.columns[0]), min(columns.stop, self.columns[1])
        if top < bottom and left < right:
            own = self.coverage[top - self.rows[0] : bottom - self.rows[0]]
            own = own[:, left - self.columns[0] : right - self.columns[0]]
            result[top - rows.start : bottom - rows.start, left - columns.start : right - columns.start] = own
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
    """Return the coverages of a whole picture of this height and width, float32 [K, H, W] in [0, 1]."""
    whole = slice(0, shape[0]), slice(0, shape[1])
    return np.array([matte.coverage_in(*whole) for matte in mattes], np.float32).reshape(-1, *shape)


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


def shape_mattes(
    mattes: Sequence[Matte], objects: Sequence[str], edges: Mapping[str, EdgeShape], photo: np.ndarray, scale: float
) -> list[Matte]:
    """Move and fade the edges of mattes in a photo, uint8 [H, W, 3]. No edge spreads into another object.

    Newly covered pixels keep the color of the background there: see `palettes.edge_planes`. scale: size of this photo
    relative to its full size.
    """
    edges = active_edges(edges)
    return [
        _shaped(matte, mattes, edges[name], photo, scale) if name in edges and matte.coverage.size else matte
        for name, matte in zip(objects, mattes, strict=True)
    ]


def _shaped(matte: Matte, mattes: Sequence[Matte], shape: EdgeShape, photo: np.ndarray, scale: float) -> Matte:
    box = slice(*matte.rows), slice(*matte.columns)
    place = dilate_bbox(box, shape.reach(scale), (photo.shape[0], photo.shape[1]))
    assert place is not None
    before = matte.coverage_in(*place)
    others = sum((other.coverage_in(*place) for other in mattes if other is not matte), np.zeros_like(before))
    after = apply_edge_shape(before, shape, scale, room=1 - others)
    rows, columns = ((each.start, each.stop) for each in place)
    # flat indices of the mixed pixels in the new box
    row, column = np.divmod(matte.mixed, matte.columns[1] - matte.columns[0])
    row, column = row + matte.rows[0] - rows[0], column + matte.columns[0] - columns[0]
    own = _own_colors(matte.mixed_colors, photo[place][row, column], before[row, column], after[row, column])
    mixed = row * (columns[1] - columns[0]) + column
    return replace(matte, rows=rows, columns=columns, coverage=after, mixed=mixed, mixed_colors=own)


def _own_colors(own: np.ndarray, seen: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return own colors uint8 [n, 3] of mixed pixels whose coverage [n] changes."""
    # seen = before x own + (1 - before) x background; where coverage grows, some of the background becomes the object's
    grown = after > before
    before, after, own_before = before[grown, None], after[grown, None], own[grown].astype(np.float32)
    background = ((seen[grown] - before * own_before) / (1 - before)).clip(0, 255)
    result = own.copy()
    result[grown] = np.rint((before * own_before + (after - before) * background) / after)
    return result
