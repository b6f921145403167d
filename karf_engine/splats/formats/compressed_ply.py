"""PlayCanvas' compressed PLY: 16 bytes per Gaussian, and one byte per harmonic above degree 0.

Format: developer.playcanvas.com, "Compressed PLY": elements `chunk` (bounds of 256 Gaussians each), `vertex` (four packed
words) and, above degree 0, `sh`. gsply packs and unpacks. Axes are those of plain PLY.

Precision: 1/2047 of a chunk's extent (y: 1/1023) for centers and log scales, 1/255 for colors and opacity, 0.003 of a
unit quaternion, 1/32 for higher harmonics, clipped to [-4, 4]. Rows are written in Z-order, which keeps chunks small.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...capture.reader_utils import read_bytes
from ...io.files import atomic_write
from ...io.ply import Element, Header, property_lines, read_header
from .checking import check_count, checked, damaged, explaining, needing_packages
from .packed import from_package, to_package
from .splat_file import SplatFile

CHUNK = 256  # Gaussians
BOUNDS = tuple(
    f"{end}_{name}" for what in ("x y z", "scale_x scale_y scale_z", "r g b") for end in ("min", "max")
    for name in what.split()
)  # fmt: skip
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
N_REST = (9, 24, 45)
CELLS = 10  # bits per coordinate of the curve


def is_compressed(data: bytes) -> bool:
    """Return whether a PLY file that starts with these bytes is compressed."""
    try:
        return read_header(data).element("chunk") is not None
    except (IndexError, KeyError, ValueError):
        return False


def read(path: Path) -> SplatFile:
    """Read Gaussians of a compressed PLY file.

    Raises:
        DataError: The file is missing, damaged or cut off, or a row is not a Gaussian.
        MissingDependency: gsply is not installed.
    """
    data = read_bytes(path)
    with explaining(path):
        header = read_header(data)
        _check(path, header, len(data))
        from gsply import decompress_from_bytes

        return SplatFile(
            checked(path, from_package(decompress_from_bytes(_plain_header(header) + data[header.size :])))
        )


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as compressed PLY, in `morton_order`; columns are dropped.

    Raises:
        MissingDependency: gsply is not installed.
        OSError: The disk takes no more, or the folder cannot be written.
    """
    with needing_packages():
        from gsply import compress_to_bytes

        data = compress_to_bytes(to_package(splats.table[morton_order(splats.table)]))
    atomic_write(path, lambda temporary: temporary.write_bytes(data))


def morton_order(table: np.ndarray) -> np.ndarray:
    """Return the Z-order [n] of the centers (G. M. Morton, 1966)."""
    centers = table[:, :3].astype(np.float64)
    low = centers.min(0)
    extent = np.maximum(centers.max(0) - low, np.finfo(np.float64).tiny)
    cells = ((centers - low) / extent * (2**CELLS - 1)).astype(np.int64)
    code = np.zeros(len(table), np.int64)
    for bit in range(CELLS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _check(path: Path, header: Header, size: int) -> None:
    """Check what gsply takes for granted: the elements, their counts and the file's length."""
    expected: list[tuple[str, np.dtype | None]] = [
        ("chunk", np.dtype([(name, "<f4") for name in BOUNDS])),
        ("vertex", np.dtype([(name, "<u4") for name in PACKED])),
    ]
    harmonics = header.element("sh")
    if harmonics is not None:
        expected.append(("sh", _harmonics_type(harmonics)))
    found = [(element.name, element.dtype) for element in header.elements]
    if header.encoding != "binary_little_endian" or found[: len(expected)] != expected:
        raise damaged(path, "its elements are not those of compressed Gaussians (chunk, vertex, sh)")
    chunk, vertex, *rest = header.elements[: len(expected)]
    n_rest = _n_properties(rest[0]) if rest else 0
    check_count(path, vertex.count, 1 + n_rest // 3, size)
    if chunk.count != -(-vertex.count // CHUNK) or any(element.count != vertex.count for element in rest):
        raise damaged(path, f"its numbers of chunks and harmonics do not fit its {vertex.count:,} Gaussians")
    if size - header.size < sum(
        element.count * element.dtype.itemsize for element in (chunk, vertex, *rest) if element.dtype
    ):
        raise damaged(path, f"it is cut off: {vertex.count:,} Gaussians do not fit into its {size:,} bytes")


def _harmonics_type(element: Element) -> np.dtype | None:
    """Return the expected type of an element of harmonics; None for an unknown number of them."""
    n_rest = _n_properties(element)
    return np.dtype([(f"f_rest_{number}", "u1") for number in range(n_rest)]) if n_rest in N_REST else None


def _n_properties(element: Element) -> int:
    """Return the number of properties of an element; 0 for one with lists."""
    return len(element.dtype.names or ()) if element.dtype is not None else 0


def _plain_header(header: Header) -> bytes:
    """Return the header in gsply's spelling, without comments."""
    lines = ["ply", f"format {header.encoding} 1.0"]
    for element in header.elements:
        if element.dtype is not None and element.name in ("chunk", "vertex", "sh"):
            lines += [f"element {element.name} {element.count}", *property_lines(element.dtype)]
    return "\n".join([*lines, "end_header", ""]).encode()
