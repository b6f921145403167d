"""Compressed files of Gaussians that gsply packs and unpacks: PlayCanvas' PLY, and Niantic's SPZ.

gsply decodes in a child process with limits of memory and time (see `registry`); only what it takes for granted is
checked here. Formats and their precision:

- compressed PLY (developer.playcanvas.com): elements `chunk` (bounds of 256 Gaussians each), `vertex` (four packed words)
  and, above degree 0, `sh`. 1/2047 of a chunk's extent (y: 1/1023) for centers and log scales, 1/255 for colors and
  opacity, 0.003 of a unit quaternion, 1/32 for higher harmonics, clipped to [-4, 4].
- SPZ (github.com/nianticlabs/spz), versions 2 to 4; 3 and 4 are written. Centers 2^-bits / 2, where the farthest
  coordinate decides the bits (at least 1.2e-7 of it); log scales 1/32, from -10 to 5.9; opacity 1/510; quaternion
  components 0.0014; harmonics of degree 0 1/76, higher ones 1/256, clipped to [-0.99, 0.99]. SPZ is right, up, back, so
  Gaussians are rotated by `upright`, as the reference does, unless the extension SPZ_ADOBE_coordinate_system declares
  other axes; version 4 is written with it. Some programs, gsply among them, do not rotate and declare nothing;
  their files cannot be told apart and appear upside down.
"""

from __future__ import annotations

import gzip
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...capture.reader_utils import read_bytes
from ...errors import BadRequest
from ...io.files import atomic_write
from ...io.ply import encode_ply, read_ply
from ..gaussians import DEGREES
from ..kernels.arrays import COLOR, LOG_SCALE, LOGIT, ROTATION
from .splat_file import SplatFile, damaged, explaining, from_axes, needing_packages, unit_rotations, upright, usable

if TYPE_CHECKING:
    from gsply import GSData

CHUNK = 256  # Gaussians
BOUNDS = np.dtype(
    [
        (f"{end}_{name}", "<f4")
        for what in ("x y z", "scale_x scale_y scale_z", "r g b")
        for end in ("min", "max")
        for name in what.split()
    ]
)
PACKED = np.dtype([(f"packed_{name}", "<u4") for name in ("position", "rotation", "scale", "color")])
CELLS = 10  # bits per coordinate of the Z-order

MAGIC, GZIP = b"NGSP", b"\x1f\x8b"
HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, degree, bits of a fraction, flags, number of streams
VERSIONS, STREAMED = (2, 3, 4), 4  # version with separately packed streams
FLAGS_AT, ANTIALIASED, EXTENDED = 14, 1, 2  # byte offset, bits
STREAMS_AT, RECORDS_AT = 16, 32  # of version 4: the offset of the table of streams, and of extensions before it
RECORD = struct.Struct("<II")  # head of an extension: kind, bytes
AXES_KIND = 0xADBE0003  # SPZ_ADOBE_coordinate_system: one number, the place in AXES; 0 declares nothing
AXES = "RUB LDB RDB LUB RUB LDF RDF LUF RUF LBD RBD LBU RBU LFD RFD LFU RFU".split()
POSITION_BITS, LEAST_BITS, MOST_BITS = 23, 1, 24  # of a coordinate without its sign; fraction bits


def to_package(table: np.ndarray) -> GSData:
    """Return gsply's container of a table [n, 11 + 3 K], with unit quaternions. Raises ImportError without gsply."""
    from gsply import GSData

    parts = (
        table[:, :LOG_SCALE],
        table[:, LOG_SCALE:ROTATION],
        unit_rotations(table),
        table[:, LOGIT],
        table[:, COLOR : COLOR + 3],
    )
    means, scales, quats, opacities, sh0 = (np.ascontiguousarray(part, np.float32) for part in parts)
    rest = np.ascontiguousarray(table[:, COLOR + 3 :], np.float32).reshape(len(table), -1, 3)
    return GSData.from_arrays(means, scales, quats, opacities, sh0, rest if rest.size else None, format="ply")


def from_package(packed: GSData) -> np.ndarray:
    """Return the table [n, 11 + 3 K] float32 of gsply's container."""
    parts = [packed.means, packed.scales, packed.quats, packed.opacities[:, None], packed.sh0]
    if packed.shN is not None and packed.shN.size:
        parts.append(packed.shN.reshape(len(packed.means), -1))
    return np.concatenate(parts, axis=1, dtype=np.float32)


# ---------------------------------------------------------------------------------------------------------- compressed PLY
def read_compressed_ply(path: Path) -> SplatFile:
    """Read Gaussians of a compressed PLY file."""
    data = read_bytes(path)
    with explaining(path):
        found = read_ply(data).tables
        tables = {name: found[name] for name in ("chunk", "vertex", "sh") if name in found}
        n_rest = len(tables["sh"].dtype.names or ()) if "sh" in tables else 0
        harmonics = np.dtype([(f"f_rest_{number}", "u1") for number in range(n_rest)])
        expected = [BOUNDS, PACKED, *([harmonics] if n_rest else [])]
        if [table.dtype for table in tables.values()] != expected or n_rest // 3 + 1 not in DEGREES:
            raise damaged(path, "its elements are not those of compressed Gaussians (chunk, vertex, sh)")
        count = len(tables["vertex"])
        if len(tables["chunk"]) != -(-count // CHUNK) or (n_rest and len(tables["sh"]) != count):
            raise damaged(path, f"its numbers of chunks and harmonics do not fit its {count:,} Gaussians")
        from gsply import decompress_from_bytes

        return usable(path, from_package(decompress_from_bytes(encode_ply(tables))))


def write_compressed_ply(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as compressed PLY, in `morton_order`; columns are dropped."""
    with needing_packages():
        from gsply import compress_to_bytes

        data = compress_to_bytes(to_package(splats.table[morton_order(splats.table)]))
    atomic_write(path, lambda temporary: temporary.write_bytes(data))


def morton_order(table: np.ndarray) -> np.ndarray:
    """Return the Z-order [n] of the centers (G. M. Morton, 1966), which keeps chunks small."""
    centers = table[:, :3].astype(np.float64)
    low = centers.min(0)
    extent = np.maximum(centers.max(0) - low, np.finfo(np.float64).tiny)
    cells = ((centers - low) / extent * (2**CELLS - 1)).astype(np.int64)
    code = np.zeros(len(table), np.int64)
    for bit in range(CELLS):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


# -------------------------------------------------------------------------------------------------------------------- SPZ
def read_spz(path: Path) -> SplatFile:
    """Read Gaussians of an SPZ file."""
    data = read_bytes(path)
    with explaining(path):
        is_gzip = data.startswith(GZIP)
        head = zlib.decompressobj(wbits=31).decompress(data, HEADER.size) if is_gzip else data[: HEADER.size]
        magic, version, _, degree, _, flags, _ = HEADER.unpack(head)
        if magic != MAGIC or version not in VERSIONS or is_gzip != (version < STREAMED):
            raise damaged(path, f"it is no SPZ file of version 2, 3 or 4 (magic {magic!r}, version {version})")
        if degree not in DEGREES.values():
            raise damaged(path, f"its harmonics are of degree {degree}; 0 to 3 are read")
        if version == STREAMED:
            import zstandard  # noqa: F401  gsply reads streams with it
        import gsply

        axes = _declared_axes(path, _extensions(data, version)) if flags & EXTENDED else AXES[0]
        table = from_axes(from_package(gsply.read_spz(path)), axes)
        return usable(path, table, bool(flags & ANTIALIASED))


def _extensions(data: bytes, version: int) -> bytes:
    """Return the extensions of an SPZ file that has some: before the streams, or behind the values of older versions."""
    if version == STREAMED:
        return data[RECORDS_AT : struct.unpack_from("<I", data, STREAMS_AT)[0]]
    data = gzip.decompress(data)
    _, _, count, degree, *_ = HEADER.unpack_from(data)
    n_bytes = 9 + 1 + 3 + 3 + (3 if version == 2 else 4) + 3 * ((degree + 1) ** 2 - 1)  # of a Gaussian
    return data[HEADER.size + count * n_bytes :]


def _declared_axes(path: Path, extensions: bytes) -> str:
    """Return the entry of AXES that extensions declare."""
    start = 0
    while start + RECORD.size <= len(extensions):
        kind, size = RECORD.unpack_from(extensions, start)
        start += RECORD.size
        if kind == AXES_KIND:
            (number,) = struct.unpack_from("<I", extensions, start)
            if number >= len(AXES):
                raise damaged(path, f"it declares the axes {number}, where 0 to {len(AXES) - 1} are known")
            return AXES[number]
        start += size
    return AXES[0]


def write_spz(path: Path, splats: SplatFile, version: int = 3) -> None:
    """Write Gaussians as SPZ; columns are dropped. Raises BadRequest if a center is out of its range.

    version: 3, which all readers know, or 4, which declares its axes.
    """
    bits = _fraction_bits(path, float(np.abs(splats.table[:, :3]).max()))

    def write_packed(temporary: Path) -> None:
        with needing_packages():
            import gsply

            if version == STREAMED:
                import zstandard  # noqa: F401  gsply packs streams with it
            gsply.write_spz(temporary, to_package(upright(splats.table)), version=version, fractional_bits=bits)
        if version == STREAMED:
            temporary.write_bytes(_declaring_axes(temporary.read_bytes(), bool(splats.is_antialiased)))
        elif splats.is_antialiased:
            data = bytearray(gzip.decompress(temporary.read_bytes()))
            data[FLAGS_AT] |= ANTIALIASED
            temporary.write_bytes(gzip.compress(data, mtime=0))

    atomic_write(path, write_packed)


def _declaring_axes(data: bytes, is_antialiased: bool) -> bytes:
    """Return the bytes of a file of version 4 without extensions with its axes and flags."""
    axes = RECORD.pack(AXES_KIND, 4) + struct.pack("<I", AXES.index("RUB", 1))
    head = bytearray(data[:RECORDS_AT])
    head[FLAGS_AT] |= EXTENDED | (ANTIALIASED if is_antialiased else 0)
    struct.pack_into("<I", head, STREAMS_AT, RECORDS_AT + len(axes))
    return bytes(head) + axes + data[RECORDS_AT:]


def _fraction_bits(path: Path, farthest: float) -> int:
    """Return the number of fraction bits that the farthest coordinate allows."""
    most = 2**POSITION_BITS - 1
    if farthest * 2**LEAST_BITS > most:
        raise BadRequest(
            "{path} cannot hold a center that is {farthest:.3g} away: SPZ ends at {most:.3g}.",
            "Write another kind of file, such as .ply, or make the scene smaller.",
            path=path,
            farthest=farthest,
            most=most / 2**LEAST_BITS,
        )
    return int(np.floor(np.log2(most / max(farthest, 2.0 ** (POSITION_BITS - MOST_BITS)))))
