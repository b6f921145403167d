"""Sparse points in PLY files, as nerfstudio writes them beside its transforms.json: x, y, z and, optionally, colors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import DataError
from ..io.ply import read_ply
from .capture import SparsePoints
from .limits import LARGEST_POSITION
from .reader_utils import read_bytes

UNCOLORED = 128


def read_points(path: Path) -> SparsePoints:
    """Read the vertices of a PLY file as points without observations; errors are nan, missing colors are gray.

    Raises:
        DataError: The file is damaged, or its vertices have no finite x, y, z.
    """
    data = read_bytes(path)
    try:
        table = read_ply(data).table("vertex")
        positions = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float64)
    except ValueError as error:
        raise _damaged(path, str(error)) from error
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


def _colors(table: np.ndarray) -> np.ndarray:
    if not {"red", "green", "blue"} <= set(table.dtype.names or ()):
        return np.full((len(table), 3), UNCOLORED, np.uint8)
    colors = np.stack([table[name] for name in ("red", "green", "blue")], 1)
    if colors.dtype.kind == "f":
        colors = np.nan_to_num(colors) * 255
    return np.clip(np.round(colors), 0, 255).astype(np.uint8)


def _damaged(path: Path, reason: str) -> DataError:
    return DataError(f"{path} cannot be read as sparse points: {reason}.", "Copy or export the file again.")
