"""Counts in binary USD files, checked before usd-core makes room for what they claim.

Format: OpenUSD, pxr/usd/sdf/crateFile.h: the bytes PXR-USDC, a version of 8 bytes, where the table of sections is; in the
table the number of sections, and of each name, start and size; a section begins with how many it holds. The section
FIELDS has what each value is and where, 64 bits each, packed by LZ4 (lz4_Block_format.md of lz4/lz4) in one block or, as
pxr/base/tf/fastCompression.cpp does with much, in several. Arrays of numbers may be packed from version 0.5 on, a billion
equal ones in a megabyte, and begin with their count. A .usdz is a zip archive of such files, not packed.
"""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np

from .checking import MOST_GROWTH

MAGIC, PACKAGE = b"PXR-USDC", b"PK\x03\x04"
TABLE_AT = 16
VERSION_AT, PACKING = 8, (0, 5)
LONG_COUNTS = (0, 7)  # the version from which on an array's count has 8 bytes
ARRAY_BIT, PACKED_BIT, PLACE = 63, 61, (1 << 48) - 1  # of the 64 bits of a value
SHORT_NUMBER, BLOCK_SIZE = struct.Struct("<I"), struct.Struct("<i")
SAME, SHORTEST = 15, 4  # LZ4: a length that goes on in further bytes; what a repetition has at least
NUMBER, SECTION, TOKENS = struct.Struct("<Q"), struct.Struct("<16sqq"), struct.Struct("<QQQ")
MOST_SECTIONS = 64
MOST_UNPACKED = 255  # bytes of one: LZ4's limit


def check_counts(data: bytes) -> None:
    """Refuse a .usdc or .usdz whose counts cannot be true of so many bytes; text is not looked at.

    Raises:
        ValueError: It says that it has more sections, names, fields or prims than there is room for.
        struct.error: It is cut off.
        zipfile.BadZipFile: The archive is damaged.
    """
    if data.startswith(PACKAGE):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            for member in archive.infolist():
                if member.compress_type != zipfile.ZIP_STORED or member.file_size > len(data):
                    raise ValueError("its archive is packed, which .usdz never is")
                check_counts(archive.read(member))
    elif data.startswith(MAGIC):
        _check_sections(data)


def _check_sections(data: bytes) -> None:
    (start,) = NUMBER.unpack_from(data, TABLE_AT)
    (count,) = NUMBER.unpack_from(data, start)
    if count > MOST_SECTIONS:
        raise ValueError(f"it says that it has {count:,} sections")
    for number in range(count):
        name, at, size = SECTION.unpack_from(data, start + NUMBER.size + SECTION.size * number)
        if at < 0 or size < 0 or at + size > len(data):
            raise ValueError("it has a section outside itself")
        (n_rows,) = NUMBER.unpack_from(data, at)
        if n_rows > len(data):
            raise ValueError(f"it says that it has {n_rows:,} rows in {len(data):,} bytes")
        if name.startswith(b"TOKENS"):
            _, unpacked, packed = TOKENS.unpack_from(data, at)
            if packed > size or unpacked > MOST_UNPACKED * size:
                raise ValueError(f"it says that it has {unpacked:,} letters in {size:,} bytes")
        if name.rstrip(b"\0") == b"FIELDS" and tuple(data[VERSION_AT : VERSION_AT + 2]) >= PACKING:
            _check_arrays(data, at, n_rows)


def _check_arrays(data: bytes, fields_at: int, n_fields: int) -> None:
    """Refuse packed arrays of more numbers than a file of this size has."""
    names_at = fields_at + NUMBER.size
    values_at = names_at + NUMBER.size + NUMBER.unpack_from(data, names_at)[0]
    (size,) = NUMBER.unpack_from(data, values_at)
    start = values_at + NUMBER.size
    values = np.frombuffer(_unpacked(data[start : start + size], 8 * n_fields), "<u8")
    count = NUMBER if tuple(data[VERSION_AT : VERSION_AT + 2]) >= LONG_COUNTS else SHORT_NUMBER
    are_packed = (values >> ARRAY_BIT & values >> PACKED_BIT & 1).astype(bool)
    for place in (values[are_packed] & PLACE).tolist():
        (n_numbers,) = count.unpack_from(data, place)
        if 4 * n_numbers > MOST_GROWTH * len(data):
            raise ValueError(f"it says that it has {n_numbers:,} numbers, in {len(data):,} bytes")


def _unpacked(packed: bytes, size: int) -> bytes:
    """What fastCompression.cpp has packed into one or several blocks.

    Raises:
        ValueError: It is not of this size.
    """
    n_blocks, result = packed[0], bytearray()
    if n_blocks == 0:
        _unpack_block(packed[1:], result, size)
    at = 1
    for _ in range(n_blocks):
        (length,) = BLOCK_SIZE.unpack_from(packed, at)
        at += BLOCK_SIZE.size
        _unpack_block(packed[at : at + length], result, size)
        at += length
    if len(result) != size:
        raise ValueError("its values are not as many as it says")
    return bytes(result)


def _unpack_block(packed: bytes, result: bytearray, most: int) -> None:
    """Append what an LZ4 block holds: sequences of literal bytes and a repetition, the last one without the latter."""
    at, start = 0, len(result)
    while at < len(packed) and len(result) <= most:
        lengths = packed[at]
        n_literal, at = _length(packed, at + 1, lengths >> 4)
        result += packed[at : at + n_literal]
        at += n_literal
        if at >= len(packed):
            return
        back = packed[at] | packed[at + 1] << 8
        n_repeated, at = _length(packed, at + 2, lengths & SAME)
        n_repeated = min(n_repeated + SHORTEST, most + 1 - len(result))
        if n_repeated < 0 or not 0 < back <= len(result) - start:
            raise ValueError("its values are packed wrongly")
        repeated = bytes(result[-back:])
        result += (repeated * (n_repeated // back + 1))[:n_repeated]


def _length(packed: bytes, at: int, length: int) -> tuple[int, int]:
    """A length of 4 bits with the bytes that go on with it, and where these end."""
    if length < SAME:
        return length, at
    while packed[at] == 255:
        length, at = length + 255, at + 1
    return length + packed[at], at + 1
