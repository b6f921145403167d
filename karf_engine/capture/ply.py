"""Sparse points in PLY files, as nerfstudio writes them beside its transforms.json.

The first element must be `vertex` with x, y, z and, where the points are colored, red, green, blue.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import DataError
from ..io.ply import read_header, read_rows
from .capture import SparsePoints
from .limits import LARGEST_POSITION
from .reading import read_bytes

UNCOLORED = 128


def read_points(path: Path) -> SparsePoints:
    """The vertices of a PLY file, without observations; errors are nan, colors gray where the file has none.

    Raises:
        DataError: The file is damaged or cut off, or has no vertices of x, y, z.
    """
    table = _vertices(path, read_bytes(path))
    positions = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float64)
    if not np.abs(positions).max(initial=0) <= LARGEST_POSITION:
        raise _damaged(path, "it has a point that is not finite")
    return SparsePoints(
        positions=positions,
        colors=_colors(table),
        errors=np.full(len(table), np.nan, np.float32),
        view=np.zeros(0, np.int32),
        point=np.zeros(0, np.int32),
        pixels=np.zeros((0, 2), np.float32),
    )


def _vertices(path: Path, data: bytes) -> np.ndarray:
    try:
        header = read_header(data)
        first = header.elements[0]
        if first.name != "vertex" or first.dtype is None or not set("xyz") <= set(first.dtype.names or ()):
            raise ValueError("its first element is not vertex with x, y, z")
    except (IndexError, KeyError, ValueError) as error:
        raise _damaged(path, f"its header cannot be understood ({error})") from error
    try:
        return read_rows(data, header, "vertex")
    except ValueError as error:
        raise _damaged(path, str(error)) from error


def _colors(table: np.ndarray) -> np.ndarray:
    if not {"red", "green", "blue"} <= set(table.dtype.names):
        return np.full((len(table), 3), UNCOLORED, np.uint8)
    colors = np.stack([table[name] for name in ("red", "green", "blue")], 1)
    if colors.dtype.kind == "f":
        colors = np.nan_to_num(colors) * 255
    return np.clip(np.round(colors), 0, 255).astype(np.uint8)


def _damaged(path: Path, reason: str) -> DataError:
    return DataError(f"{path} cannot be read as sparse points: {reason}.", "Copy or export the file again.")
