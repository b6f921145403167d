"""Picture sizes from file headers, without a picture library.

Follows the PNG specification (IHDR), JPEG (ITU T.81, SOFn segments), Exif 2.3 (orientation tag 0x0112) and the WebP
container specification (VP8, VP8L and VP8X chunks). Sizes are (width, height) in pixels.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..errors import DataError

LFS_POINTER = b"version https://git-lfs"
FRAME_MARKERS = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True)
class ImageHeader:
    """Size of the stored pixels; `turned` says that the Exif orientation swaps width and height for display."""

    width: int
    height: int
    turned: bool = False

    @property
    def stored(self) -> tuple[int, int]:
        """Width and height as stored."""
        return self.width, self.height

    @property
    def shown(self) -> tuple[int, int]:
        """Width and height as a viewer shows the picture."""
        return (self.height, self.width) if self.turned else self.stored


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of a PNG, JPEG or WebP file as shown. Raises DataError naming the file and its damage."""
    return image_header(path).shown


def image_header(path: Path) -> ImageHeader:
    """Read the header of a PNG, JPEG or WebP file. Raises DataError naming the file and its damage."""
    try:
        with path.open("rb") as stream:
            head = stream.read(32)
            header = _header(head, stream)
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}.", "Check the file.") from error
    except struct.error:
        header = None
    if header is None or min(header.stored) < 1:
        raise unreadable(path, "it has no complete PNG, JPEG or WebP header")
    return header


def unreadable(path: Path, reason: str) -> DataError:
    """The error for a picture that cannot be read: names the known kinds of damage, else gives `reason`."""
    with path.open("rb") as stream:
        head = stream.read(32)
    if not head:
        return DataError(f"{path} is empty.", "Copy the picture again.")
    if head.startswith(LFS_POINTER):
        return DataError(f"{path} is a Git-LFS pointer, not a picture.", "Fetch the pictures with: git lfs pull.")
    if head.startswith(b"\xef\xbf\xbd"):
        return DataError(f"{path} is damaged: it was copied as text.", "Copy the picture again as a binary file.")
    return DataError(f"{path} cannot be read as a picture: {reason}.", "Export or copy the picture again.")


def _header(head: bytes, stream: BinaryIO) -> ImageHeader | None:
    if head[:8] == b"\x89PNG\r\n\x1a\n" and head[12:16] == b"IHDR":
        return ImageHeader(*struct.unpack(">II", head[16:24]))
    if head[:2] == b"\xff\xd8":
        stream.seek(2)
        return _jpeg_header(stream)
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return _webp_header(head)
    return None


def _jpeg_header(stream: BinaryIO) -> ImageHeader | None:
    turned = False
    while True:
        marker = _jpeg_marker(stream)
        if marker in (None, 0xD9, 0xDA):  # the picture data begins and no size was given
            return None
        if marker == 0x01 or 0xD0 <= marker <= 0xD8:  # markers without a segment
            continue
        (length,) = struct.unpack(">H", stream.read(2))
        segment = stream.read(length - 2)
        if marker == 0xE1 and segment[:6] == b"Exif\0\0":
            turned = _exif_orientation(segment[6:]) >= 5
        if marker in FRAME_MARKERS:
            height, width = struct.unpack(">HH", segment[1:5])
            return ImageHeader(width, height, turned)


def _jpeg_marker(stream: BinaryIO) -> int | None:
    if stream.read(1) != b"\xff":
        return None
    marker = 0xFF
    while marker == 0xFF:  # fill bytes
        (marker,) = struct.unpack("B", stream.read(1))
    return marker


def _exif_orientation(tiff: bytes) -> int:
    """Orientation 1..8 of an Exif block; 1 where it says none or is damaged, as viewers do."""
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])
    if order is None:
        return 1
    block = io.BytesIO(tiff)
    try:
        block.seek(struct.unpack(order + "I", tiff[4:8])[0])
        (count,) = struct.unpack(order + "H", block.read(2))
        for _ in range(count):
            tag, _, _, value = struct.unpack(order + "HHIH2x", block.read(12))
            if tag == 0x0112:
                return value
    except struct.error:
        pass
    return 1


def _webp_header(head: bytes) -> ImageHeader | None:
    chunk, data = head[12:16], head[20:]
    if chunk == b"VP8 " and data[3:6] == b"\x9d\x01\x2a":
        width, height = struct.unpack("<HH", data[6:10])
        return ImageHeader(width & 0x3FFF, height & 0x3FFF)
    if chunk == b"VP8L" and data[:1] == b"\x2f":
        (bits,) = struct.unpack("<I", data[1:5])
        return ImageHeader((bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1)
    if chunk == b"VP8X" and len(data) >= 10:
        return ImageHeader(int.from_bytes(data[4:7], "little") + 1, int.from_bytes(data[7:10], "little") + 1)
    return None
