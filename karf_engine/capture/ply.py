"""Sparse points in PLY files, as nerfstudio writes them beside its transforms.json.

Format: G. Turk, "The PLY Polygon File Format": ASCII or binary; the first element must be `vertex` with x, y, z and,
where the points are colored, red, green, blue. Own code, since Blender's Python reads these too, with numpy alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import DataError
from .capture import SparsePoints
from .limits import LARGEST_POSITION
from .reading import read_bytes

TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
UNCOLORED = 128


def read_points(path: Path) -> SparsePoints:
    """The vertices of a PLY file, without observations; errors are nan, colors gray where the file has none.

    Raises:
        DataError: The file is damaged or cut off, or has no vertices of x, y, z.
    """
    header, _, body = read_bytes(path).partition(b"end_header")
    encoding, dtype, count = _layout(path, header)
    body = body[body.find(b"\n") + 1 :]
    table = _ascii(path, body, dtype, count) if encoding == "ascii" else _binary(path, body, dtype, count)
    positions = np.stack([table[axis] for axis in "xyz"], 1).astype(np.float64)
    if not np.abs(positions).max(initial=0) <= LARGEST_POSITION:
        raise _damaged(path, "it has a point that is not finite")
    return SparsePoints(
        positions=positions,
        colors=_colors(table),
        errors=np.full(count, np.nan, np.float32),
        view=np.zeros(0, np.int32),
        point=np.zeros(0, np.int32),
        pixels=np.zeros((0, 2), np.float32),
    )


def _layout(path: Path, header: bytes) -> tuple[str, np.dtype, int]:
    """The encoding, and the vertices' type and number."""
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    words = [line for line in lines if line and line[0] not in ("comment", "obj_info")]
    try:
        if words[0] != ["ply"]:
            raise ValueError("it does not begin with ply")
        encoding = words[1][1]
        order = ORDERS[encoding]
        _, name, count = words[2]
        fields = []
        for kind, *rest in words[3:]:
            if kind != "property":
                break  # the next element
            fields.append((rest[1], order + TYPES[rest[0]]))
        dtype = np.dtype(fields)
        if name != "vertex" or int(count) < 0 or not set("xyz") <= set(dtype.names or ()):
            raise ValueError("its first element is not vertex with x, y, z")
    except (IndexError, KeyError, ValueError) as error:
        raise _damaged(path, f"its header cannot be understood ({error})") from error
    return encoding, dtype, int(count)


def _binary(path: Path, body: bytes, dtype: np.dtype, count: int) -> np.ndarray:
    if len(body) < count * dtype.itemsize:
        raise _damaged(path, f"it is cut off: {count} points do not fit into its {len(body)} bytes")
    return np.frombuffer(body, dtype, count)


def _ascii(path: Path, body: bytes, dtype: np.dtype, count: int) -> np.ndarray:
    words = body.split()
    if len(words) < count * len(dtype):
        raise _damaged(path, f"it is cut off: {count} points do not fit into its {len(words)} numbers")
    try:
        rows = np.array(words[: count * len(dtype)], np.float64).reshape(count, len(dtype))
    except ValueError as error:
        raise _damaged(path, "its points are not numbers") from error
    table = np.empty(count, dtype)
    with np.errstate(invalid="ignore"):  # nan in place of a whole number
        for name, column in zip(dtype.names, rows.T, strict=True):
            table[name] = column
    return table


def _colors(table: np.ndarray) -> np.ndarray:
    if not {"red", "green", "blue"} <= set(table.dtype.names):
        return np.full((len(table), 3), UNCOLORED, np.uint8)
    colors = np.stack([table[name] for name in ("red", "green", "blue")], 1)
    if colors.dtype.kind == "f":
        colors = np.nan_to_num(colors) * 255
    return np.clip(np.round(colors), 0, 255).astype(np.uint8)


def _damaged(path: Path, reason: str) -> DataError:
    return DataError(f"{path} cannot be read as sparse points: {reason}.", "Copy or export the file again.")
