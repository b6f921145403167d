"""Gaussians in PLY files as Kerbl et al. 2023 write them.

Layout: graphdeco-inria/gaussian-splatting, scene/gaussian_model.py: one `vertex` each, with x y z, f_dc_0..2,
f_rest_0..44 (channel by channel: all of red, then green, then blue), opacity (logit), scale_0..2 (logarithm), rot_0..3
(w x y z). f_rest has 0, 9, 24 or 45 properties. nx ny nz are ignored, other properties become `columns`. Properties may
have any order and any PLY type, as text or binary. Comments name the screen filter: Brush's `SplatRenderMode: mip`,
Postshot's `antialiased 1`.

Values are float32 in memory and on disk, so a round trip is exact. Three kinds of files are read as what they stand for,
and keep their own values when rewritten:

- Mip-Splatting (Yu et al. 2024): `filter_3D`, world units, widens scales and lowers opacities, as its `save_fused_ply` does.
- 2D Gaussian Splatting (Huang et al. 2024): without scale_2, Gaussians are flat.
- Rows that are not Gaussians are skipped.
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
from ...io.ply import Header, Ply, encode_ply, read_ply
from ..gaussians import DEGREES
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION
from .splat_file import SplatFile, damaged, explaining, logits, usable_rows

GEOMETRY = ("x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity")
NORMALS = ("nx", "ny", "nz")
FILTER = "filter_3D"
THICKNESS, FLAT = "scale_2", np.log(1e-6)  # of a flat Gaussian
FILTERED = re.compile(r"(SplatRenderMode: mip|antialiased 1)\s*$", re.IGNORECASE)
UNFILTERED = re.compile(r"(SplatRenderMode: default|antialiased 0)\s*$", re.IGNORECASE)


def read(path: Path) -> SplatFile:
    """Read Gaussians of a PLY file; other properties become `columns`, in the file's types."""
    return open_original(path).splats


@dataclass(frozen=True)
class Original:
    """A PLY file of Gaussians with all its bytes."""

    path: Path
    splats: SplatFile  # as `read` returns it
    rows: np.ndarray  # of its Gaussians, [n] int64
    _ply: Ply

    @property
    def is_text(self) -> bool:
        """True for a text file, which cannot be changed in place."""
        return self._ply.header.encoding == "ascii"


def open_original(path: Path) -> Original:
    """Read a PLY file of Gaussians with its bytes, for `rewrite`. Raises as `read`."""
    data = read_bytes(path)
    with explaining(path):
        ply = read_ply(data)
        rows = ply.table("vertex")
    names = _names_in(path, rows)
    have = rows.dtype.names or ()
    table = np.empty((len(rows), len(names)), np.float32)
    with np.errstate(over="ignore"):
        for number, name in enumerate(names):
            table[:, number] = rows[name] if name in have else FLAT
    if FILTER in have:
        _fuse(table, rows[FILTER], LOG_SCALE + sum(name.startswith("scale_") for name in have if name in names))
    table, is_usable = usable_rows(path, table)
    foreign = [name for name in have if name not in {*names, *NORMALS, FILTER}]
    columns = {name: rows[name][is_usable].astype(rows.dtype[name].newbyteorder("=")) for name in foreign}
    splats = SplatFile(table, _filter_of(ply.header), columns, int(np.sum(~is_usable)))
    return Original(path, splats, np.flatnonzero(is_usable), ply)


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians and their columns as binary PLY in the order of Kerbl et al., with normals of 0."""
    names = property_names(splats.table.shape[1])
    rest = [f"f_rest_{number}" for number in range(len(names) - COLOR - 3)]
    ordered = [*names[:3], *NORMALS, *names[COLOR : COLOR + 3], *rest, *GEOMETRY[10:], *GEOMETRY[3:10]]
    more = [(name, column.dtype.newbyteorder("<")) for name, column in splats.columns.items()]
    rows = np.zeros(len(splats), [(name, "<f4") for name in ordered] + more)
    for name, column in zip(names, splats.table.T, strict=True):
        rows[name] = column
    for name, column in splats.columns.items():
        rows[name] = column
    mode = {None: (), True: ("SplatRenderMode: mip",), False: ("SplatRenderMode: default",)}[splats.is_antialiased]
    atomic_write(path, lambda temporary: temporary.write_bytes(encode_ply({"vertex": rows}, mode)))


def rewrite(original: Original, out: Path, table: np.ndarray, columns: Mapping[str, np.ndarray] | None = None) -> None:
    """Write a binary PLY file with changed values; all other bytes stay, also of skipped rows.

    Raises DataError for a text file, and ValueError for changed values that the file does not hold as they are read.

    Args:
        original: The file; `out` may be the same.
        table: [n, 11 + 3 K] float32; only values that differ from the file's are written.
        columns: Values [n] by name: existing properties are replaced in their types, others are added behind the last.
    """
    if original.is_text:
        raise DataError(
            f"{original.path} is a PLY file of text, which is not changed in place.", "Save it as binary PLY."
        )
    rows, old, columns = original._ply.tables["vertex"], original.splats.table, columns or {}
    if table.shape != old.shape:
        raise ValueError(f"a table of {table.shape} for a file of {old.shape}")
    order = ">" if original._ply.header.encoding == "binary_big_endian" else "<"
    names = rows.dtype.names or ()
    fields = [(name, rows.dtype[name]) for name in names]
    fields += [(name, each.dtype.newbyteorder(order)) for name, each in columns.items() if name not in names]
    written = np.zeros(len(rows), fields)
    for name in names:
        written[name] = rows[name]
    derived = {*GEOMETRY[LOG_SCALE:ROTATION], GEOMETRY[LOGIT]} if FILTER in names else {*GEOMETRY} - {*names}
    for name, before, after in zip(property_names(old.shape[1]), old.T, table.T, strict=True):
        differs = before != after  # other values keep their full precision
        if name in derived and differs.any():
            raise ValueError(f"{name} of {original.path} is not stored as it is read")
        if name in names:
            written[name][original.rows[differs]] = after[differs]
    for name, column in columns.items():
        written[name][original.rows] = column
    content = original._ply.with_vertices(written)
    atomic_write(out, lambda temporary: temporary.write_bytes(content))


def property_names(width: int) -> list[str]:
    """Return the layout's names of a table's columns. width: 11 + 3 K.

    Examples:
        >>> property_names(23)[14:]
        ['f_rest_0', 'f_rest_3', 'f_rest_6', 'f_rest_1', 'f_rest_4', 'f_rest_7', 'f_rest_2', 'f_rest_5', 'f_rest_8']
    """
    n_rest = (width - COLOR) // 3 - 1
    rest = [f"f_rest_{channel * n_rest + number}" for number in range(n_rest) for channel in range(3)]
    return [*GEOMETRY, "f_dc_0", "f_dc_1", "f_dc_2", *rest]


def _names_in(path: Path, rows: np.ndarray) -> list[str]:
    """Return the layout's names of the columns of the file's degree."""
    have = set(rows.dtype.names or ())
    n_rest = sum(name.startswith("f_rest_") for name in have)
    if n_rest % 3 or n_rest // 3 + 1 not in DEGREES:
        raise damaged(path, f"it has {n_rest} properties f_rest, where 0, 9, 24 or 45 are known")
    names = property_names(COLOR + 3 + n_rest)
    lacking = [name for name in names if name not in have and name != THICKNESS]
    if lacking:
        raise damaged(path, f"its vertices have no {' '.join(lacking)}")
    return names


def _fuse(table: np.ndarray, sizes: np.ndarray, end: int) -> None:
    """Widen the Gaussians of a table, in place, by the 3D filter of Mip-Splatting. sizes: [n]. end: of the stored scales."""
    scales = table[:, LOG_SCALE:end].astype(np.float64)
    with np.errstate(all="ignore"):
        widened = np.logaddexp(2 * scales, 2 * np.log(np.abs(sizes, dtype=np.float64))[:, None]) / 2
        shares = np.exp((scales - widened).sum(1))  # square root of the ratio of determinants
        table[:, LOG_SCALE:end] = widened
        table[:, LOGIT] = logits(shares / (1 + np.exp(-table[:, LOGIT].astype(np.float64))))


def _filter_of(header: Header) -> bool | None:
    if any(map(FILTERED.match, header.comments)):
        return True
    return False if any(map(UNFILTERED.match, header.comments)) else None
