"""Mattes with moved and faded edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...palettes.edge_shape import EdgeShape, active_edges, apply_edge_shape, dilate_bbox
from .matte import Matte


def shape_mattes(
    mattes: Sequence[Matte], objects: Sequence[str], edges: Mapping[str, EdgeShape], photo: np.ndarray, scale: float
) -> list[Matte]:
    """Move and fade the edges of mattes. No edge spreads into another object.

    Newly covered pixels keep the color of the background there: see `palettes.edge_planes`.

    Args:
        mattes: Of the K objects, in one photo.
        objects: Names of the objects.
        edges: By object; others stay unchanged.
        photo: uint8 [H, W, 3].
        scale: Size of this photo relative to its full size.
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
    before = _coverage_in(matte, place)
    others = sum((_coverage_in(other, place) for other in mattes if other is not matte), np.zeros_like(before))
    after = apply_edge_shape(before, shape, scale, room=1 - others)
    rows, columns = ((each.start, each.stop) for each in place)
    # flat indices of the mixed pixels in the new box
    row, column = np.divmod(matte.mixed, matte.columns[1] - matte.columns[0])
    row, column = row + matte.rows[0] - rows[0], column + matte.columns[0] - columns[0]
    own = _own_colors(matte.mixed_colors, photo[place][row, column], before[row, column], after[row, column])
    mixed = row * (columns[1] - columns[0]) + column
    return replace(matte, rows=rows, columns=columns, coverage=after, mixed=mixed, mixed_colors=own)


def _own_colors(own: np.ndarray, seen: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return own colors uint8 [n, 3] of mixed pixels whose coverage [n] changes.

    With seen = before x own + (1 - before) x background, the new own color is
    (before x own + (after - before) x background) / after where the coverage grows.
    """
    grown = after > before
    before, after, own_before = before[grown, None], after[grown, None], own[grown].astype(np.float32)
    background = ((seen[grown] - before * own_before) / (1 - before)).clip(0, 255)
    result = own.copy()
    result[grown] = np.rint((before * own_before + (after - before) * background) / after)
    return result


def _coverage_in(matte: Matte, place: tuple[slice, slice]) -> np.ndarray:
    """Return a matte's coverage in a box of the photo, [h, w] float32."""
    rows, columns = place
    result = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.float32)
    top, bottom = max(rows.start, matte.rows[0]), min(rows.stop, matte.rows[1])
    left, right = max(columns.start, matte.columns[0]), min(columns.stop, matte.columns[1])
    if top < bottom and left < right:
        own = matte.coverage[top - matte.rows[0] : bottom - matte.rows[0]]
        own = own[:, left - matte.columns[0] : right - matte.columns[0]]
        result[top - rows.start : bottom - rows.start, left - columns.start : right - columns.start] = own
    return result
