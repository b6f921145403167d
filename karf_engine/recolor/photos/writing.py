"""Edited photos in their file's format, with color profile and metadata.

PNG: the ancillary chunks of the photo's own file, or those that Pillow makes of another file's profile, Exif, XMP and
resolution (PNG specification, third edition, 11.3). TIFF: OpenCV's strips with the photo's descriptive tags (TIFF 6.0;
Exif 2.3), since no library writes 16-bit colors with Exif. EXR: the file itself with other colors.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
import OpenEXR
from PIL import Image, JpegImagePlugin, PngImagePlugin
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from ...io.files import atomic_write
from ...io.images import encode_image, paste
from ...io.library_paths import library_path, save_exr
from .stored import StoredPhoto

SUFFIXES = {"png": ".png", "tiff": ".tif", "exr": ".exr"}  # by kind; others become PNG
JPEG_QUALITY = 97
PNG_LEVEL = 3  # zlib compression: higher levels are several times slower for a few percent
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_CHUNKS = {
    b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"cICP", b"mDCV", b"cLLI", b"pHYs", b"eXIf", b"tEXt", b"zTXt", b"iTXt"
}  # fmt: skip
ORIENTATION = 0x0112
EXIF_IFD, GPS_IFD, INTEROPERABILITY_IFD, ICC_PROFILE = 34665, 34853, 40965, 34675
TIFF_LAYOUT = (256, 257, 258, 259, 262, 277, 278, 284, 317, 338, 339)  # tags of the size and coding of the pixels
STRIP_OFFSETS, STRIP_BYTES, EXTRA_SAMPLES = 273, 279, 338
TIFF_METADATA = (
    269, 270, 271, 272, 274, 282, 283, 285, 296, 301, 305, 306, 315, 316, 318, 319, 700, 33432, 33723, 34377,
    ICC_PROFILE, EXIF_IFD, GPS_IFD, 40091, 40092, 40093, 40094, 40095,
)  # fmt: skip
LOSSY_EXR = ("PXR24_COMPRESSION", "B44_COMPRESSION", "B44A_COMPRESSION", "DWAA_COMPRESSION", "DWAB_COMPRESSION")


def suffix_for(photo: StoredPhoto, jpeg: bool = False) -> str:
    """Return the suffix of an edited copy: `.png`, `.tif` or `.exr` as the photo's, `.png` for all others.

    jpeg: whether a JPEG stays a JPEG, which changes pixels outside the edit.
    """
    return ".jpg" if jpeg and photo.header.kind == "jpeg" else SUFFIXES.get(photo.header.kind, ".png")


def write_photo(path: Path, photo: StoredPhoto) -> None:
    """Write an edited photo, atomically, with the metadata of its file: orientation, Exif, profile, resolution, texts.

    The pixels stay in the stored grid, so that the file can replace the photo. path: with the suffix of `suffix_for`.
    """
    write = {".png": _write_png, ".tif": _write_tiff, ".exr": _write_exr, ".jpg": _write_jpeg}[path.suffix]
    atomic_write(path, lambda temporary: write(temporary, photo))


def write_mask(path: Path, mask: np.ndarray, orientation: int) -> None:
    """Write a mask [H, W] of a photo's stored grid as a PNG of 0 and 255, with the photo's Exif orientation."""
    options: dict[str, Any] = {}
    if orientation != 1:
        options["exif"] = Image.Exif()
        options["exif"][ORIENTATION] = orientation
    atomic_write(path, lambda temporary: Image.fromarray(mask).convert("L").save(temporary, **options))


# --- PNG
def _write_png(path: Path, photo: StoredPhoto) -> None:
    coded = encode_image(".png", photo.pixels, [cv2.IMWRITE_PNG_COMPRESSION, PNG_LEVEL])
    header_end = len(PNG_SIGNATURE) + 25  # the IHDR chunk is first and 25 bytes long
    with path.open("wb") as file:
        file.write(coded[:header_end])
        for kind, content in _png_metadata(photo):
            file.write(struct.pack(">I", len(content)) + kind + content)
            file.write(struct.pack(">I", zlib.crc32(content, zlib.crc32(kind))))
        file.write(coded[header_end:])


def _png_metadata(photo: StoredPhoto) -> Iterator[tuple[bytes, bytes]]:
    """Yield the photo's metadata chunks."""
    if photo.header.kind == "png":
        content = photo.path.read_bytes()
    else:
        metadata, texts = _metadata(photo), PngImagePlugin.PngInfo()
        if xmp := metadata.pop("xmp", None):
            texts.add_itxt("XML:com.adobe.xmp", xmp)
        content = _one_pixel_png(metadata | {"pnginfo": texts})
    for kind, data in _png_chunks(content):
        is_gray_profile = kind == b"iCCP" and not _is_rgb(zlib.decompress(data[data.index(b"\0") + 2 :]))
        if kind in PNG_CHUNKS and not is_gray_profile:
            yield kind, data


def _one_pixel_png(metadata: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (1, 1)).save(stream, "png", **metadata)
    return stream.getvalue()


def _png_chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = len(PNG_SIGNATURE)
    while at + 8 <= len(content):
        length, kind = struct.unpack_from(">I4s", content, at)
        yield kind, content[at + 8 : at + 8 + length]
        at += length + 12


def _is_rgb(profile: bytes) -> bool:
    """Return whether an ICC profile is RGB; gray and CMYK profiles do not fit the written pixels."""
    return profile[16:20] == b"RGB "


def _metadata(photo: StoredPhoto) -> dict[str, Any]:
    """Return profile, Exif, XMP and resolution of a photo, as arguments of Pillow's writers."""
    with Image.open(photo.path) as file:
        found = {name: file.info[name] for name in ("icc_profile", "exif", "dpi", "xmp") if file.info.get(name)}
    if not _is_rgb(found.get("icc_profile", b"")):
        found.pop("icc_profile", None)
    return found


# --- JPEG
def _write_jpeg(path: Path, photo: StoredPhoto) -> None:
    with Image.open(photo.path) as file:
        sampling = JpegImagePlugin.get_sampling(file)
    metadata = _metadata(photo)
    Image.fromarray(photo.pixels).save(path, quality=JPEG_QUALITY, subsampling=max(sampling, 0), **metadata)


# --- TIFF
def _write_tiff(path: Path, photo: StoredPhoto) -> None:
    content = encode_image(".tif", photo.pixels)
    coded, metadata = _directory(io.BytesIO(content)), _tiff_metadata(photo)
    directory = ImageFileDirectory_v2()
    for tag in TIFF_LAYOUT:
        if tag in coded:
            directory[tag] = coded[tag]
    for tag, value in metadata.items():
        directory.tagtype[tag] = metadata.tagtype[tag]
        directory[tag] = value
    if photo.pixels.shape[-1] == 4:
        directory[EXTRA_SAMPLES] = 1 if photo.is_premultiplied else 2
    sizes = np.array(coded[STRIP_BYTES])
    directory[STRIP_BYTES] = tuple(sizes.tolist())
    directory.tagtype[STRIP_OFFSETS] = directory.tagtype[STRIP_BYTES] = 4
    directory[STRIP_OFFSETS] = tuple((np.cumsum(sizes) - sizes).tolist())  # Pillow adds the offset of the data
    with path.open("wb") as file:
        directory.save(file)
        for first, size in zip(coded[STRIP_OFFSETS], sizes, strict=True):
            file.write(content[first : first + size])


def _directory(file: BinaryIO, tag: int | None = None, at: int | None = None) -> ImageFileDirectory_v2:
    """Read the first directory of a TIFF, or the one of a tag at an offset."""
    file.seek(0)
    directory = ImageFileDirectory_v2(file.read(8), group=tag)
    file.seek(directory.next if at is None else at)
    directory.load(file)
    return directory


def _tiff_metadata(photo: StoredPhoto) -> ImageFileDirectory_v2:
    """Return the photo's descriptive tags, with its Exif and GPS directories."""
    kept = ImageFileDirectory_v2()
    with photo.path.open("rb") as file:
        found = _directory(file)
        for tag in TIFF_METADATA:
            if tag not in found or (tag == ICC_PROFILE and not _is_rgb(found[tag])):
                continue
            kept.tagtype[tag] = found.tagtype[tag]
            if tag in (EXIF_IFD, GPS_IFD):
                inner = _directory(file, tag, found[tag])
                kept[tag] = {key: value for key, value in inner.items() if key != INTEROPERABILITY_IFD}
            else:
                kept[tag] = found[tag]
    return kept


# --- EXR
def _write_exr(path: Path, photo: StoredPhoto) -> None:
    with library_path(photo.path) as readable:
        file = OpenEXR.File(readable)
    header = file.header()
    window, shown = np.array(header["dataWindow"]), np.array(header["displayWindow"])
    width, height = (shown[1] - shown[0] + 1).tolist()
    if photo.size != (width, height):
        _write_new_exr(path, photo, header["compression"])
        return
    name = photo.channels
    channel = file.channels()[name]
    pixels = np.repeat(channel.pixels[..., None], photo.pixels.shape[-1], -1) if name == "Y" else channel.pixels.copy()
    paste(photo.pixels, pixels, shown[0] - window[0])
    if name == "Y":
        del file.channels()[name]
        file.channels()["RGB"] = OpenEXR.Channel("RGB", pixels)
    else:
        channel.pixels = pixels
    header["compression"] = _lossless(header["compression"])
    save_exr(file, path)


def _write_new_exr(path: Path, photo: StoredPhoto, compression: OpenEXR.Compression) -> None:
    """Write a reduced photo: its colors alone."""
    header = {"compression": _lossless(compression), "type": OpenEXR.scanlineimage}
    channels = "RGBA" if photo.pixels.shape[-1] == 4 else "RGB"
    save_exr(OpenEXR.File(header, {channels: np.ascontiguousarray(photo.pixels)}), path)


def _lossless(compression: OpenEXR.Compression) -> OpenEXR.Compression:
    """Replace a lossy compression, which would change pixels outside the edit."""
    return OpenEXR.ZIP_COMPRESSION if compression.name in LOSSY_EXR else compression
