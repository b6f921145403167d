"""Mattes whose edges an edit has moved and faded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...palettes.edge_shape import EdgeShape, grown_box, shaped, shaped_edges
from .matte import Matte


def shaped_mattes(
    mattes: Sequence[Matte], objects: Sequence[str], edges: Mapping[str, EdgeShape], photo: np.ndarray, scale: float
) -> list[Matte]:
    """Mattes with the edges that an edit wants. No edge spreads into another object.

    What an edge newly covers keeps the color that it had beside the object: see `palettes.edge_planes`.

    Args:
        mattes: Of the K objects, in one photo.
        objects: Their names.
        edges: By object; those without one stay as they are.
        photo: uint8 [H, W, 3].
        scale: Pixels of this photo for one of it at its full size.

    Returns:
        One for each object.
    """
    edges = shaped_edges(edges)
    return [
        _shaped(matte, mattes, edges[name], photo, scale) if name in edges and matte.coverage.size else matte
        for name, matte in zip(objects, mattes, strict=True)
    ]


def _shaped(matte: Matte, mattes: Sequence[Matte], shape: EdgeShape, photo: np.ndarray, scale: float) -> Matte:
    box = slice(*matte.rows), slice(*matte.columns)
    place = grown_box(box, shape.reach(scale), photo.shape[:2])
    before = _coverage_in(matte, place)
    others = sum((_coverage_in(other, place) for other in mattes if other is not matte), np.zeros_like(before))
    after = shaped(before, shape, scale, room=1 - others)
    rows, columns = ((each.start, each.stop) for each in place)
    # the pixels that are mixed, counted in the new box
    row, column = np.divmod(matte.mixed, matte.columns[1] - matte.columns[0])
    row, column = row + matte.rows[0] - rows[0], column + matte.columns[0] - columns[0]
    own = _own_colors(matte.mixed_colors, photo[place][row, column], before[row, column], after[row, column])
    mixed = row * (columns[1] - columns[0]) + column
    return replace(matte, rows=rows, columns=columns, coverage=after, mixed=mixed, mixed_colors=own)


def _own_colors(own: np.ndarray, seen: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Own colors, uint8 [n, 3], of mixed pixels whose coverage [n] becomes another: what is new has the color beside.

    A pixel shows before x own + (1 - before) x beside, so that after x (own then) is before x own + (after - before) x
    beside.
    """
    grown = after > before
    before, after, own_before = before[grown, None], after[grown, None], own[grown].astype(np.float32)
    beside = ((seen[grown] - before * own_before) / (1 - before)).clip(0, 255)
    result = own.copy()
    result[grown] = np.rint((before * own_before + (after - before) * beside) / after)
    return result


def _coverage_in(matte: Matte, place: tuple[slice, slice]) -> np.ndarray:
    """A matte's coverage in a box of the photo, [h, w] float32."""
    rows, columns = place
    result = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.float32)
    top, bottom = max(rows.start, matte.rows[0]), min(rows.stop, matte.rows[1])
    left, right = max(columns.start, matte.columns[0]), min(columns.stop, matte.columns[1])
    if top < bottom and left < right:
        own = matte.coverage[top - matte.rows[0] : bottom - matte.rows[0]]
        own = own[:, left - matte.columns[0] : right - matte.columns[0]]
        result[top - rows.start : bottom - rows.start, left - columns.start : right - columns.start] = own
    return result
