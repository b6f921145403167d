"""Colored points as binary little-endian PLY (G. Turk, "The PLY Polygon File Format")."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..io.color import to_bytes
from ..io.files import atomic_write
from ..io.ply import encode_vertices

VERTEX = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")] + [(c, "u1") for c in ("red", "green", "blue")]
)


def write_ply(path: Path, positions: np.ndarray, normals: np.ndarray, colors: np.ndarray) -> None:
    """Write points with positions, normals and sRGB colors in [0, 1], each [N, 3], atomically.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_ply(Path(folder) / "one.ply", np.zeros((1, 3)), np.eye(3)[:1], np.ones((1, 3)))
        ...     content = (Path(folder) / "one.ply").read_bytes()
        >>> content.split(b"end_header")[0].decode().split("\\n")[:4]
        ['ply', 'format binary_little_endian 1.0', 'element vertex 1', 'property float x']
        >>> content[-3:]
        b'\\xff\\xff\\xff'
    """
    table = np.empty(len(positions), VERTEX)
    for names, values in (("x y z", positions), ("nx ny nz", normals), ("red green blue", to_bytes(colors))):
        for name, column in zip(names.split(), values.T, strict=True):
            table[name] = column
    atomic_write(path, lambda temporary: temporary.write_bytes(encode_vertices(table)))
