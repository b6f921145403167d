"""Counts in binary USD files, checked before usd-core makes room for what they claim.

Format: OpenUSD, pxr/usd/sdf/crateFile.h: the bytes PXR-USDC, a version of 8 bytes, where the table of sections is; in the
table the number of sections, and of each name, start and size; a section begins with how many it holds. The section
FIELDS has what each value is and where, 64 bits each, packed. Arrays of numbers may be packed from version 0.5 on, a billion
equal ones in a megabyte, and begin with their count (see `usd_packing`). A .usdz is a zip archive of such files, not packed.
"""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np

from .checking import MOST_GROWTH
from .usd_packing import NUMBER, SHORT_NUMBER, check_array, unpacked

MAGIC, PACKAGE = b"PXR-USDC", b"PK\x03\x04"
TABLE_AT = 16
VERSION_AT, PACKING = 8, (0, 5)
LONG_COUNTS = (0, 7)  # the version from which on an array's count has 8 bytes
ARRAY_BIT, PACKED_BIT, KIND_AT, PLACE = 63, 61, 48, (1 << 48) - 1  # of the 64 bits of a value
SECTION, TOKENS = struct.Struct("<16sqq"), struct.Struct("<QQQ")
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
    """Refuse packed arrays of more numbers than a file of this size has, and those that are damaged."""
    names_at = fields_at + NUMBER.size
    values_at = names_at + NUMBER.size + NUMBER.unpack_from(data, names_at)[0]
    (size,) = NUMBER.unpack_from(data, values_at)
    start = values_at + NUMBER.size
    values = np.frombuffer(unpacked(data[start : start + size], 8 * n_fields), "<u8")
    count = NUMBER if tuple(data[VERSION_AT : VERSION_AT + 2]) >= LONG_COUNTS else SHORT_NUMBER
    are_packed = (values >> ARRAY_BIT & values >> PACKED_BIT & 1).astype(bool)
    for value in values[are_packed].tolist():
        place, kind = value & PLACE, value >> KIND_AT & 0xFF
        (n_numbers,) = count.unpack_from(data, place)
        if 4 * n_numbers > MOST_GROWTH * len(data):
            raise ValueError(f"it says that it has {n_numbers:,} numbers, in {len(data):,} bytes")
        check_array(data, place + count.size, n_numbers, kind)
