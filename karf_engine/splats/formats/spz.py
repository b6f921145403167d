"""Niantic's SPZ, about a tenth of the size of PLY.

Format: github.com/nianticlabs/spz, versions 2 to 4; version 3 is written. gsply packs and unpacks. SPZ stores right, up,
back (RUB), so centers, rotations and harmonics are rotated here (see `turning`), as the reference does. Some programs,
gsply among them, do not rotate; their files cannot be told apart and appear upside down.

Precision: centers 2^-bits / 2, where the farthest coordinate decides the bits (at least 1.2e-7 of it); log scales 1/32,
from -10 to 5.9; opacity 1/510; quaternion components 0.0014; harmonics of degree 0 1/76, higher ones 1/256, clipped to
[-0.99, 0.99].
"""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...capture.reader_utils import read_bytes
from ...errors import BadRequest
from ...io.files import atomic_write
from .checking import check_count, checked, damaged, explaining, needing_packages
from .packed import from_package, to_package
from .splat_file import SplatFile
from .turning import upright

MAGIC = b"NGSP"
GZIP = b"\x1f\x8b"
HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, degree, bits of a fraction, flags, number of streams
STREAM = struct.Struct("<QQ")  # bytes packed, unpacked
STREAMS_AT = 16  # offset of the offset of version 4's table of streams
STREAMED = 4  # the first version with separately packed streams
VERSIONS = (2, 3, STREAMED)
BYTES = {0: 20, 1: 29, 2: 44, 3: 65}  # per Gaussian by degree; one less in version 2
FLAGS_AT = 14  # byte offset
ANTIALIASED = 1
POSITION_BITS, LEAST_BITS, MOST_BITS = 23, 1, 24  # of a coordinate without its sign; fraction bits
BLOCK = 1 << 20  # bytes


@dataclass(frozen=True)
class _Header:
    version: int
    count: int
    degree: int
    flags: int
    n_streams: int

    @property
    def n_bytes(self) -> int:
        """Unpacked size of all Gaussians."""
        return self.count * (BYTES[self.degree] - (self.version == VERSIONS[0]))


def read(path: Path) -> SplatFile:
    """Read Gaussians of an SPZ file.

    Raises:
        DataError: The file is missing, damaged or cut off, of an unknown version, or a row is not a Gaussian.
        MissingDependency: gsply, or for version 4 zstandard, is not installed.
    """
    data = read_bytes(path)
    with explaining(path):
        header = _checked_header(path, data)
        from gsply import read_spz

        table = upright(from_package(read_spz(path)))
    return SplatFile(checked(path, table), bool(header.flags & ANTIALIASED))


def write(path: Path, splats: SplatFile) -> None:
    """Write Gaussians as SPZ version 3; columns are dropped.

    Raises:
        BadRequest: A center is out of range of its fixed-point numbers.
        MissingDependency: gsply is not installed.
        OSError: The disk takes no more, or the folder cannot be written.
    """
    bits = _fraction_bits(path, float(np.abs(splats.table[:, :3]).max()))

    def write_packed(temporary: Path) -> None:
        with needing_packages():
            from gsply import write_spz

            write_spz(temporary, to_package(upright(splats.table)), version=3, fractional_bits=bits)
        if splats.is_antialiased:
            _flag_antialiased(temporary)

    atomic_write(path, write_packed)


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


def _flag_antialiased(path: Path) -> None:
    data = bytearray(gzip.decompress(path.read_bytes()))
    data[FLAGS_AT] |= ANTIALIASED
    path.write_bytes(gzip.compress(data, mtime=0))


def _checked_header(path: Path, data: bytes) -> _Header:
    """Return the header after checking its count against the packed bytes."""
    is_packed = data.startswith(GZIP)
    head = zlib.decompressobj(wbits=31).decompress(data, HEADER.size) if is_packed else data[: HEADER.size]
    magic, version, count, degree, _, flags, n_streams = HEADER.unpack(head)
    header = _Header(version, count, degree, flags, n_streams)
    if magic != MAGIC or version not in VERSIONS or is_packed != (version < STREAMED):
        raise damaged(path, f"it is no SPZ file of version 2, 3 or 4 (magic {magic!r}, version {version})")
    if degree not in BYTES:
        raise damaged(path, f"its harmonics are of degree {degree}; 0 to 3 are read")
    check_count(path, count, (degree + 1) ** 2, len(data))
    if is_packed:
        _check_unpacked(path, data, header)
    else:
        _check_streams(path, data, header)
    return header


def _check_unpacked(path: Path, data: bytes, header: _Header) -> None:
    """Check the unpacked size by unpacking block by block."""
    unpacker, rest, found = zlib.decompressobj(wbits=31), data, 0
    most = header.n_bytes + BLOCK  # extensions may follow
    while rest and not unpacker.eof and found <= most:
        found += len(unpacker.decompress(rest, BLOCK))
        rest = unpacker.unconsumed_tail
    if not unpacker.eof or unpacker.unused_data or not HEADER.size + header.n_bytes <= found <= most:
        raise damaged(path, f"its packed bytes are not those of {header.count:,} Gaussians")


def _check_streams(path: Path, data: bytes, header: _Header) -> None:
    import zstandard

    (at,) = struct.unpack_from("<I", data, STREAMS_AT)
    sizes = [STREAM.unpack_from(data, at + STREAM.size * number) for number in range(header.n_streams)]
    start = at + STREAM.size * header.n_streams
    if sum(unpacked for _, unpacked in sizes) != header.n_bytes:
        raise damaged(path, f"its streams are not those of {header.count:,} Gaussians")
    for packed, unpacked in sizes:
        if zstandard.frame_content_size(data[start : start + packed]) not in (unpacked, -1):
            raise damaged(path, "a stream has another length than the table of streams says")
        start += packed
