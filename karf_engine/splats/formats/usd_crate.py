"""Counts in binary USD files, checked before usd-core makes room for what they claim.

Format: OpenUSD, pxr/usd/sdf/crateFile.h: the bytes PXR-USDC, a version of 8 bytes, where the table of sections is; in the
table the number of sections, and of each name, start and size; a section begins with how many it holds. A .usdz is a zip
archive of such files, not packed.
"""

from __future__ import annotations

import io
import struct
import zipfile

MAGIC, PACKAGE = b"PXR-USDC", b"PK\x03\x04"
TABLE_AT = 16
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
