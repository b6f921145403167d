"""Image sizes from file headers, with the standard library only. Sizes are (width, height) in pixels.

Reads PNG (IHDR, eXIf), JPEG (ITU T.81, SOFn segments), Exif 2.3 orientation, WebP (VP8, VP8L and VP8X chunks), TIFF 6.0
(first directory), Windows bitmaps, OpenEXR (displayWindow), and HEIC and AVIF (ISO/IEC 23008-12, the properties ispe,
irot and imir of the primary item).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from ..errors import DataError
from .files import check_file, refusing_unreadable

LFS_POINTER = b"version https://git-lfs"
FRAME_MARKERS = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
TIFF_ORDERS = {b"II*\0": "<", b"MM\0*": ">"}
MOST_PHOTO_BYTES = 2 << 30
MOST_EXIF_BYTES = 1 << 16  # the largest JPEG segment
MOST_PROFILE_BYTES = 4 << 20  # those of printers have some 2 MB
# limits of decompression bombs: photographs and renderings need at least a bit for six pixels
MOST_PIXELS = 400_000_000
MOST_PIXELS_OF_SMALL = 32_000_000
MOST_PIXELS_PER_BYTE = 50
KINDS = "PNG, JPEG, WebP, TIFF, BMP, EXR, HEIC or AVIF"
HEIF_BRANDS = {b"avif": "avif", b"avis": "avif", b"heic": "heic", b"heix": "heic", b"mif1": "heic", b"msf1": "heic"}
RAW_SUFFIXES = (".dng", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr")
ORIENTATIONS = {
    None: (1, 8, 3, 6),
    0: (4, 5, 2, 7),
    1: (2, 7, 4, 5),
}  # of Exif, by HEIF's mirror axis and quarter turns
OTHER_KINDS = {  # first bytes: what the file is
    b"GIF8": "a GIF",
    b"8BPS": "a Photoshop document",
    b"\xff\x0a": "a JPEG XL",
    b"\0\0\0\x0cJXL ": "a JPEG XL",
    b"\0\0\0\x0cjP  ": "a JPEG 2000",
    b"%PDF": "a PDF",
    b"<svg": "an SVG drawing",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1aE\xdf\xa3": "a video",
}
MOST_META_BYTES = 4 << 20  # of the description of a HEIC or AVIF file


@dataclass(frozen=True)
class ImageHeader:
    """Size and pixel format of an image file, as stored."""

    width: int
    height: int
    orientation: int = 1  # of Exif, 1..8
    kind: str = ""  # png, jpeg, webp, tiff, bmp, exr, heic or avif
    deep: bool = False  # whether colors have more than 8 bits a channel
    premultiplied: bool = False  # whether colors are multiplied by alpha
    depth: int = 1  # bytes of a channel
    profile: bytes = field(default=b"", repr=False)  # its ICC profile, read of PNG and JPEG alone

    @property
    def swaps_sides(self) -> bool:
        """Whether the orientation swaps width and height for display."""
        return self.orientation >= 5

    @property
    def stored_size(self) -> tuple[int, int]:
        return self.width, self.height

    @property
    def display_size(self) -> tuple[int, int]:
        """Width and height for display."""
        return (self.height, self.width) if self.swaps_sides else self.stored_size


def image_size(path: Path) -> tuple[int, int]:
    """Return width and height for display. Raises what `image_header` raises."""
    return image_header(path).display_size


def image_header(path: Path) -> ImageHeader:
    """Read the header of an image file. Raises DataError if it is missing, damaged, of another kind or too large."""
    with refusing_unreadable(path):
        header = find_header(path)
    if header is None or path.suffix.lower() in RAW_SUFFIXES:
        raise unreadable_image_error(path, f"it has no complete {KINDS} header")
    check_pixels(path, *header.stored_size)
    return header


def check_pixels(
    path: Path, width: int, height: int, min_pixel_limit: int = MOST_PIXELS_OF_SMALL, depth: int = 1
) -> None:
    """Raise DataError for an image file that claims too many pixels for its length.

    The smallest file may have `min_pixel_limit`. Above two bytes of a channel (`depth`), limits shrink in proportion.
    """
    length = path.stat().st_size
    most = min(MOST_PIXELS, max(min_pixel_limit, MOST_PIXELS_PER_BYTE * length)) * 2 // max(2, depth)
    if width * height > most:
        raise DataError(
            f"{path} has {width}x{height} pixels in {length:,} bytes; at most {most // 10**6} million are read of that.",
            "Export the picture again, or make it smaller.",
        )


def find_header(path: Path) -> ImageHeader | None:
    """Read the header of an image file; None if it is damaged or of an unknown kind.

    Raises OSError if the file cannot be read, DataError if it is missing or not a regular file.
    """
    check_file(path, MOST_PHOTO_BYTES)
    with path.open("rb") as stream:
        try:
            header = _header(stream.read(32), stream)
        except (struct.error, IndexError):
            return None
    return header if header and min(header.stored_size) >= 1 else None


def unreadable_image_error(path: Path, reason: str) -> DataError:
    """Return the error for an image that cannot be read; common kinds of damage replace the reason."""
    with path.open("rb") as stream:
        head = stream.read(32)
    if not head:
        return DataError("{path} is empty.", "Copy the picture again.", path=path)
    if head.startswith(LFS_POINTER):
        return DataError(
            "{path} is a Git-LFS pointer, not a picture.", "Fetch the pictures with: git lfs pull.", path=path
        )
    if path.suffix.lower() in RAW_SUFFIXES:
        return DataError(
            "{path} is a raw file of a camera.",
            "Develop all photos to JPEG or 16-bit TIFF of the same names and size, without cropping or lens correction.",
            path=path,
        )
    kind = next((kind for start, kind in OTHER_KINDS.items() if head.startswith(start)), "")
    if not kind and head[4:8] == b"ftyp" and head[8:12] not in HEIF_BRANDS:
        kind = "a video"
    if kind:
        return DataError(
            "{path} is {kind}, not a photo that can be read.", f"Export it as {KINDS}.", path=path, kind=kind
        )
    if head.startswith(b"\xef\xbf\xbd"):
        return DataError(f"{path} is damaged: it was copied as text.", "Copy the picture again as a binary file.")
    return DataError(
        "{path} cannot be read as a picture: {reason}.", "Export or copy the picture again.", path=path, reason=reason
    )


def _header(head: bytes, stream: BinaryIO) -> ImageHeader | None:
    if head[:8] == b"\x89PNG\r\n\x1a\n" and head[12:16] == b"IHDR":
        return _png_header(head, stream)
    if head[:2] == b"\xff\xd8":
        return _jpeg_header(stream)
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return _webp_header(head)
    if head[:4] in TIFF_ORDERS:
        return _tiff_header(stream)
    if head[:2] == b"BM":
        return _bmp_header(head)
    if head[:4] == b"\x76\x2f\x31\x01":
        return _exr_header(stream)
    if head[4:8] == b"ftyp":
        return _heif_header(stream)
    return None


def _png_header(head: bytes, stream: BinaryIO) -> ImageHeader:
    width, height, bits, color = struct.unpack(">IIBB", head[16:26])
    orientation, profile = 1, b""
    stream.seek(8)
    while len(start := stream.read(8)) == 8:
        length, kind = struct.unpack(">I4s", start)
        if kind == b"IDAT":
            break
        end = stream.tell() + length + 4
        if kind == b"eXIf":
            orientation = _exif_orientation(stream.read(min(length, MOST_EXIF_BYTES)))
        if kind == b"iCCP":
            profile = _png_profile(stream.read(min(length, MOST_PROFILE_BYTES)))
        stream.seek(end)
    is_deep = bits > 8 and color != 0  # color 0: gray
    return ImageHeader(width, height, orientation, "png", deep=is_deep, profile=profile)


def _png_profile(chunk: bytes) -> bytes:
    """Return the ICC profile of an iCCP chunk: a name, a zero, the method and the packed profile; empty if damaged."""
    try:
        return zlib.decompressobj().decompress(chunk.partition(b"\0")[2][1:], MOST_PROFILE_BYTES)
    except zlib.error:
        return b""


def _jpeg_header(stream: BinaryIO) -> ImageHeader | None:
    stream.seek(2)
    orientation, profile = 1, b""
    while True:
        marker = _jpeg_marker(stream)
        if marker in (None, 0xD9, 0xDA):  # pixel data without a frame header
            return None
        if marker == 0x01 or 0xD0 <= marker <= 0xD8:  # markers without a segment
            continue
        (length,) = struct.unpack(">H", stream.read(2))
        if length < 2:  # includes its own two bytes
            return None
        segment = stream.read(length - 2)
        if marker == 0xE1 and segment[:6] == b"Exif\0\0":
            orientation = _exif_orientation(segment[6:])
        if marker == 0xE2 and segment[:12] == b"ICC_PROFILE\0":  # two bytes that number its parts follow
            profile += segment[14:]
        if marker in FRAME_MARKERS:
            height, width = struct.unpack(">HH", segment[1:5])
            return ImageHeader(width, height, orientation, "jpeg", profile=profile)


def _jpeg_marker(stream: BinaryIO) -> int | None:
    if stream.read(1) != b"\xff":
        return None
    marker = 0xFF
    while marker == 0xFF:  # fill bytes
        (marker,) = struct.unpack("B", stream.read(1))
    return marker


def _exif_orientation(tiff: bytes) -> int:
    """Return the orientation of an Exif block; 1 if it has none or is damaged."""
    try:
        return _orientation(_tiff_fields(io.BytesIO(tiff)))
    except struct.error:
        return 1


def _orientation(fields: dict[int, tuple[int, ...]]) -> int:
    value = fields.get(0x0112, (1,))[0]
    return value if 1 <= value <= 8 else 1


def _tiff_fields(stream: BinaryIO) -> dict[int, tuple[int, ...]]:
    """Return the 16- and 32-bit fields of the first directory by tag; empty if the stream is not a TIFF."""
    stream.seek(0)
    order = TIFF_ORDERS.get(stream.read(4))
    if order is None:
        return {}
    stream.seek(struct.unpack(order + "I", stream.read(4))[0])
    (count,) = struct.unpack(order + "H", stream.read(2))
    entries = [struct.unpack(order + "HHI4s", stream.read(12)) for _ in range(count)]
    fields = {}
    for tag, kind, length, inline in entries:
        letter = {3: "H", 4: "I"}.get(kind)
        if letter is None or not 1 <= length <= 16:  # strings and strip tables are not needed
            continue
        layout = f"{order}{length}{letter}"
        size = struct.calcsize(layout)
        if size > 4:
            stream.seek(struct.unpack(order + "I", inline)[0])
            inline = stream.read(size)
        fields[tag] = struct.unpack(layout, inline[:size])
    return fields


def _tiff_header(stream: BinaryIO) -> ImageHeader | None:
    fields = _tiff_fields(stream)
    if 0x0100 not in fields or 0x0101 not in fields:
        return None
    bits = max(fields.get(0x0102, (1,)))
    return ImageHeader(
        fields[0x0100][0],
        fields[0x0101][0],
        _orientation(fields),
        "tiff",
        deep=bits > 8 and fields.get(0x0115, (1,))[0] > 1,
        premultiplied=fields.get(0x0152, (0,))[0] == 1,  # ExtraSamples: associated alpha
        depth=bits // 8,
    )


def _bmp_header(head: bytes) -> ImageHeader:
    is_core = struct.unpack("<I", head[14:18])[0] == 12
    width, height = struct.unpack("<HH", head[18:22]) if is_core else struct.unpack("<ii", head[18:26])
    return ImageHeader(width, abs(height), kind="bmp")  # negative height: top row first


def _exr_header(stream: BinaryIO) -> ImageHeader | None:
    stream.seek(8)
    while name := _exr_text(stream):
        _exr_text(stream)  # the attribute's type
        (size,) = struct.unpack("<I", stream.read(4))
        if name == b"displayWindow":
            left, top, right, bottom = struct.unpack("<4i", stream.read(16))
            return ImageHeader(right - left + 1, bottom - top + 1, kind="exr", deep=True, premultiplied=True)
        stream.seek(size, io.SEEK_CUR)
    return None


def _exr_text(stream: BinaryIO) -> bytes:
    """Read a zero-terminated string of at most 255 characters."""
    text = b""
    while len(text) < 256 and (letter := stream.read(1)) not in (b"", b"\0"):
        text += letter
    return text


def _webp_header(head: bytes) -> ImageHeader | None:
    chunk, data = head[12:16], head[20:]
    if chunk == b"VP8 " and data[3:6] == b"\x9d\x01\x2a":
        width, height = struct.unpack("<HH", data[6:10])
        return ImageHeader(width & 0x3FFF, height & 0x3FFF, kind="webp")
    if chunk == b"VP8L" and data[:1] == b"\x2f":
        (bits,) = struct.unpack("<I", data[1:5])
        return ImageHeader((bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1, kind="webp")
    if chunk == b"VP8X" and len(data) >= 10:
        width, height = (int.from_bytes(data[at : at + 3], "little") + 1 for at in (4, 7))
        return ImageHeader(width, height, kind="webp")
    return None


def _heif_header(stream: BinaryIO) -> ImageHeader | None:
    """Read the size of the primary item: grids of tiles, as phones write them, have sizes of tiles too."""
    stream.seek(0)
    file = dict(_boxes(stream.read(MOST_META_BYTES)))
    brands = [file.get(b"ftyp", b"")[at : at + 4] for at in (0, *range(8, 64, 4))]
    kind = next((HEIF_BRANDS[brand] for brand in brands if brand in HEIF_BRANDS), "")
    meta = dict(_boxes(file.get(b"meta", b"")[4:]))
    properties = dict(_boxes(meta.get(b"iprp", b"")))
    primary = meta.get(b"pitm", b"")
    if not (kind and properties and primary):
        return None
    (item,) = struct.unpack_from(">I" if primary[0] else ">H", primary, 4)
    stored = list(_boxes(properties.get(b"ipco", b"")))
    own = dict(stored[n - 1] for n in _associations(properties.get(b"ipma", b""), item) if 0 < n <= len(stored))
    width, height = struct.unpack_from(">II", own.get(b"ispe", b""), 4)
    turns, mirror = own.get(b"irot", b"\0")[0] % 4, own[b"imir"][0] % 2 if b"imir" in own else None
    if kind == "heic" and turns % 2 == 1:  # its decoder turns the pixels; that of AVIF gives an orientation
        width, height = height, width
    return ImageHeader(width, height, 1 if kind == "heic" else ORIENTATIONS[mirror][turns], kind)


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield type and content of each box of the ISO base media format; the last one may be cut off."""
    at = 0
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        start = at + 8
        if size == 1 and at + 16 <= len(data):
            (size,) = struct.unpack_from(">Q", data, start)
            start = at + 16
        end = at + size if size else len(data)
        if end < start:
            return
        yield kind, data[start:end]
        at = end


def _associations(data: bytes, wanted: int) -> list[int]:
    """Return the numbers, from 1, of the properties that an ipma box gives to an item."""
    version, flags, count = data[0], data[3], struct.unpack_from(">I", data, 4)[0]
    at = 8
    for _ in range(count):
        (item,) = struct.unpack_from(">I" if version else ">H", data, at)
        at += 4 if version else 2
        number, at = data[at], at + 1
        layout = f">{number}{'H' if flags & 1 else 'B'}"
        indices = struct.unpack_from(layout, data, at)
        at += struct.calcsize(layout)
        if item == wanted:
            return [index & (0x7FFF if flags & 1 else 0x7F) for index in indices]
    return []
