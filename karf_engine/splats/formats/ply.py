"""Gaussians in PLY files as Kerbl et al. 2023 write them.

Layout: graphdeco-inria/gaussian-splatting, scene/gaussian_model.py: one `vertex` each, with x y z, f_dc_0..2,
f_rest_0..44 (channel by channel: all of red, then green, then blue), opacity (logit), scale_0..2 (logarithm), rot_0..3
(w x y z). f_rest has 0, 9, 24 or 45 properties. nx ny nz are ignored, other properties become `columns`. Properties may
have any order and any PLY type, as text or binary. Comments name the screen filter: Brush's `SplatRenderMode: mip`,
Postshot's `antialiased 1`.

Values are float32 in memory and on disk, so a round trip is exact.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...capture.reader_utils import read_bytes
from ...errors import DataError
from ...io.files import atomic_write
from ...io.ply import Header, encode_vertices, find_element, property_lines, read_header, read_rows
from ..gaussians import DEGREES
from ..kernels.arrays import COLOR
from .checking import checked, damaged, explaining
from .splat_file import SplatFile

GEOMETRY = ("x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity")
NORMALS = ("nx", "ny", "nz")
FILTERED = re.compile(r"(SplatRenderMode: mip|antialiased 1)\s*$", re.IGNORECASE)
UNFILTERED = re.compile(r"(SplatRenderMode: default|antialiased 0)\s*$", re.IGNORECASE)


def read(path: Path) -> SplatFile:
    """Read Gaussians of a PLY file; other properties become `columns`, in the file's types.

    Raises:
        DataError: The file is missing, damaged, cut off or not a PLY of Gaussians, or a row is not a Gaussian.
    """
    return open_original(path).splats


@dataclass(frozen=True)
class Original:
    """A PLY file of Gaussians with all its bytes.

    Attributes:
        path: The file.
        splats: Its Gaussians, as `read` returns them.
    """

    path: Path
    splats: SplatFile
    _data: bytes
    _header: Header
    _rows: np.ndarray

    @property
    def is_text(self) -> bool:
        """Whether the file is text, which cannot be changed in place."""
        return self._header.encoding == "ascii"


def open_original(path: Path) -> Original:
    """Read a PLY file of Gaussians with its bytes, for `rewrite`. Raises as `read`."""
    data = read_bytes(path)
    with explaining(path):
        header = read_header(data)
        rows = read_rows(data, header, "vertex")
    names = _names_in(path, rows)
    foreign = [name for name in rows.dtype.names or () if name not in {*names, *NORMALS}]
    columns = {name: rows[name].astype(rows.dtype[name].newbyteorder("=")) for name in foreign}
    return Original(path, SplatFile(_table(path, rows, names), _filter_of(header), columns), data, header, rows)


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians and their columns as binary PLY in the order of Kerbl et al., with normals of 0.

    Raises:
        ValueError: A column has the name of a property of the layout, or a type unknown to PLY.
        OSError: The disk takes no more, or the folder cannot be written.
    """
    names = property_names(splats.table.shape[1])
    ordered = [*names[:3], *NORMALS, *names[COLOR : COLOR + 3], *_rest(names), *GEOMETRY[10:], *GEOMETRY[3:10]]
    more = [(name, column.dtype.newbyteorder("<")) for name, column in splats.columns.items()]
    rows = np.zeros(len(splats), [(name, "<f4") for name in ordered] + more)
    for name, column in zip(names, splats.table.T, strict=True):
        rows[name] = column
    for name, column in splats.columns.items():
        rows[name] = column
    mode = {None: (), True: ("SplatRenderMode: mip",), False: ("SplatRenderMode: default",)}[splats.is_antialiased]
    atomic_write(path, lambda temporary: temporary.write_bytes(encode_vertices(rows, mode)))


def rewrite(original: Original, out: Path, table: np.ndarray, columns: Mapping[str, np.ndarray] | None = None) -> None:
    """Write a PLY file with changed values; all other bytes stay.

    Args:
        original: The file, binary.
        out: The file to write; may be the same.
        table: [n, 11 + 3 K] float32; only values that differ from the file's are written.
        columns: Values [n] by name: existing properties are replaced in their types, others are added behind the last.

    Raises:
        DataError: The file is text.
        ValueError: Table or columns have another shape than the file, or a column has a type unknown to PLY.
    """
    data, header, rows = original._data, original._header, original._rows
    if original.is_text:
        raise DataError(
            f"{original.path} is a PLY file of text, which is not changed in place.", "Save it as binary PLY."
        )
    columns = columns or {}
    changed = _changed(rows, original.splats.table, table)
    new = {name: column for name, column in columns.items() if name not in (rows.dtype.names or ())}
    written = _widened(changed, {name: column.dtype for name, column in new.items()}, header)
    for name, column in columns.items():
        written[name] = column
    vertex, start = find_element(header, "vertex")
    end = header.size + start + rows.nbytes
    head = _with_properties(
        data[: header.size], vertex.end, property_lines(written.dtype)[len(rows.dtype.names or ()) :]
    )
    content = b"".join((head, data[header.size : header.size + start], written.tobytes(), data[end:]))
    atomic_write(out, lambda temporary: temporary.write_bytes(content))


def property_names(width: int) -> list[str]:
    """Return the layout's names of a table's columns.

    Args:
        width: 11 + 3 K, with K = 1, 4, 9 or 16 harmonics.

    Examples:
        >>> property_names(14)[10:]
        ['opacity', 'f_dc_0', 'f_dc_1', 'f_dc_2']
        >>> property_names(23)[14:]
        ['f_rest_0', 'f_rest_3', 'f_rest_6', 'f_rest_1', 'f_rest_4', 'f_rest_7', 'f_rest_2', 'f_rest_5', 'f_rest_8']
    """
    n_rest = (width - COLOR) // 3 - 1
    rest = [f"f_rest_{channel * n_rest + number}" for number in range(n_rest) for channel in range(3)]
    return [*GEOMETRY, "f_dc_0", "f_dc_1", "f_dc_2", *rest]


def _rest(names: list[str]) -> list[str]:
    return [f"f_rest_{number}" for number in range(len(names) - COLOR - 3)]


def _names_in(path: Path, rows: np.ndarray) -> list[str]:
    """Return the layout's names of the columns of the file's degree."""
    have = set(rows.dtype.names or ())
    n_rest = sum(name.startswith("f_rest_") for name in have)
    if n_rest % 3 or n_rest // 3 + 1 not in DEGREES:
        raise damaged(path, f"it has {n_rest} properties f_rest, where 0, 9, 24 or 45 are known")
    names = property_names(COLOR + 3 + n_rest)
    lacking = [name for name in names if name not in have]
    if lacking:
        raise damaged(path, f"its vertices have no {' '.join(lacking)}")
    return names


def _table(path: Path, rows: np.ndarray, names: list[str]) -> np.ndarray:
    table = np.empty((len(rows), len(names)), np.float32)
    with np.errstate(over="ignore"):
        for number, name in enumerate(names):
            table[:, number] = rows[name]
    return checked(path, table)


def _filter_of(header: Header) -> bool | None:
    if any(map(FILTERED.match, header.comments)):
        return True
    return False if any(map(UNFILTERED.match, header.comments)) else None


def _changed(rows: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return the file's rows with the values that differ between two tables; others keep their full precision."""
    if new.shape != old.shape:
        raise ValueError(f"a table of {new.shape} for a file of {old.shape}")
    changed = rows.copy()
    for name, before, after in zip(property_names(old.shape[1]), old.T, new.T, strict=True):
        differs = before != after
        changed[name][differs] = after[differs]
    return changed


def _widened(rows: np.ndarray, new: Mapping[str, np.dtype], header: Header) -> np.ndarray:
    """Return the rows with new fields, in the file's byte order."""
    order = ">" if header.encoding == "binary_big_endian" else "<"
    fields = [(name, rows.dtype[name]) for name in rows.dtype.names or ()]
    wide = np.zeros(len(rows), fields + [(name, dtype.newbyteorder(order)) for name, dtype in new.items()])
    for name, _ in fields:
        wide[name] = rows[name]
    return wide


def _with_properties(header: bytes, end: int, lines: list[str]) -> bytes:
    """Insert lines at a position of a header, with its line ends."""
    line_end = "\r\n" if header[:end].endswith(b"\r\n") else "\n"
    return header[:end] + "".join(line + line_end for line in lines).encode() + header[end:]
