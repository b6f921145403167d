"""Photos as stored in their files, and edited copies with the same size, bit depth, color profile and metadata.

The stored grid is that of the file before its Exif orientation is applied. Values that no edit changes are never
converted, so that an edited copy has the same bits. Copies are written as

- PNG: the ancillary chunks of the photo's own file, or those that Pillow makes of another file's profile, Exif, XMP and
  resolution (PNG specification, third edition, 11.3);
- TIFF: OpenCV's strips with the photo's descriptive tags (TIFF 6.0; Exif 2.3), since no library writes 16-bit colors with
  Exif;
- EXR: the file itself with other colors.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
import OpenEXR
from PIL import Image, JpegImagePlugin, PngImagePlugin
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from ..capture.camera import Camera, wrong_size_error
from ..io.color import srgb_to_linear, to_bytes
from ..io.color_spaces import ColorSpace
from ..io.files import atomic_write, library_path
from ..io.icc import Space
from ..io.image_size import ImageHeader, find_header
from ..io.images import (
    INVERSE_EXIF_ORIENTATION,
    alpha_composite,
    apply_exif_orientation_copy,
    convert_to_srgb,
    decoding,
    display_colors,
    embedded_space,
    encode_image,
    paste,
    read_light,
    read_pixels,
    resize,
    save_exr,
    unpremultiply,
    white_level,
)

WHOLE = slice(None)
LARGEST_HALF = float(np.finfo(np.float16).max)
SUFFIXES = {"png": ".png", "tiff": ".tif", "exr": ".exr"}  # by kind; others become PNG
JPEG_QUALITY = 97
PNG_LEVEL = 3  # zlib compression: higher levels are several times slower for a few percent
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_CHUNKS = {
    b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"cICP", b"mDCV", b"cLLI", b"pHYs", b"eXIf", b"tEXt", b"zTXt", b"iTXt"
}  # fmt: skip
ORIENTATION = 0x0112
EXIF_IFD, GPS_IFD, INTEROPERABILITY_IFD, ICC_PROFILE, XMP = 34665, 34853, 40965, 34675, 700
TIFF_LAYOUT = (256, 257, 258, 259, 262, 277, 278, 284, 317, 338, 339)  # tags of the size and coding of the pixels
STRIP_OFFSETS, STRIP_BYTES, EXTRA_SAMPLES = 273, 279, 338
TIFF_METADATA = (
    269, 270, 271, 272, 274, 282, 283, 285, 296, 301, 305, 306, 315, 316, 318, 319, XMP, 33432, 33723, 34377,
    ICC_PROFILE, EXIF_IFD, GPS_IFD, 40091, 40092, 40093, 40094, 40095,
)  # fmt: skip
LOSSY_EXR = ("PXR24_COMPRESSION", "B44_COMPRESSION", "B44A_COMPRESSION", "DWAA_COMPRESSION", "DWAB_COMPRESSION")


@dataclass(frozen=True)
class StoredPhoto:
    """A photo's pixels in the stored grid.

    EXR: linear light with premultiplied alpha, on the display window. Others: sRGB, gray and palettes as three channels.
    """

    path: Path
    header: ImageHeader
    pixels: np.ndarray  # [H, W, 3 or 4], of an EXR also 1: uint8, uint16, float32 or float16
    channels: str = ""  # name of an EXR's channels
    space: ColorSpace | Space | None = None  # of the stored colors; None: as above
    keeps_xmp: bool = True  # whether copies get the file's XMP

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the stored grid."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def is_premultiplied(self) -> bool:
        return self.pixels.shape[-1] == 4 and self.header.deep and self.header.premultiplied

    @cached_property
    def is_opaque(self) -> bool:
        return self.pixels.shape[-1] < 4 or bool((self.pixels[..., 3] >= white_level(self.pixels)).all())

    def orientation_for(self, camera: Camera) -> int:
        """Return the Exif orientation from the stored grid to the camera's. Raises DataError for a camera of another size."""
        known = (camera.width, camera.height)
        width, height = self.size
        if known == ((height, width) if self.header.swaps_sides else self.size):
            return self.header.orientation
        if known == self.size:
            return 1
        raise wrong_size_error(self.path, width, height, camera)

    def colors(self, rows: slice | np.ndarray = WHOLE, columns: slice | np.ndarray = WHOLE) -> np.ndarray:
        """Return straight sRGB colors, float32 [h, w, 3] in [0, 1]."""
        stored = self.pixels[rows, columns]
        if self.channels:
            return display_colors(stored.astype(np.float32), self.space)[..., :3]
        values = np.clip(stored.astype(np.float32) / white_level(stored), 0, 1)
        colors = unpremultiply(values) if self.is_premultiplied else values[..., :3]
        return colors if self.space is None else convert_to_srgb(colors, self.space)

    def alpha(self, rows: slice = WHOLE, columns: slice = WHOLE) -> np.ndarray | None:
        """Return alpha, float32 [h, w] in [0, 1]; None if the whole photo is opaque."""
        if self.is_opaque:
            return None
        stored = self.pixels[rows, columns, 3]
        return np.clip(stored.astype(np.float32) / white_level(stored), 0, 1)

    def over_white(self, rows: slice = WHOLE, columns: slice = WHOLE) -> np.ndarray:
        """Return colors over white: uint8 sRGB [h, w, 3]."""
        stored = self.pixels[rows, columns]
        if stored.dtype == np.uint8 and self.is_opaque and self.space is None:
            return stored[..., :3]
        return to_bytes(alpha_composite(self.colors(rows, columns), self.alpha(rows, columns)))

    def copy(self) -> StoredPhoto:
        """Return a copy with its own pixels, gray ones expanded to RGB."""
        channels = max(3, self.pixels.shape[-1])
        return replace(self, pixels=np.array(np.broadcast_to(self.pixels, (*self.pixels.shape[:2], channels))))

    def change(self, rows: slice, columns: slice, change: np.ndarray) -> None:
        """Add a change [h, w, 3] of the straight sRGB colors to some pixels, in place.

        Pixels whose change is zero keep their bits. Light above 1 is kept: the edit is added to the clipped color.
        """
        touched = change.any(-1)
        stored = self.pixels[rows, columns]
        before = self.colors(rows, columns)[touched]
        after = np.clip(before + change[touched], 0, 1)
        difference = (self._stored_colors(after) - self._stored_colors(before)) * white_level(stored)
        if self.is_premultiplied:
            difference = difference * np.clip(stored[touched][:, 3:].astype(np.float32) / white_level(stored), 0, 1)
        stored[..., :3][touched] = _sum(stored[..., :3][touched], difference)

    def _stored_colors(self, colors: np.ndarray) -> np.ndarray:
        """Convert sRGB colors [n, 3] to the file's encoding, full value 1."""
        if self.space is not None:
            return self.space.from_srgb(colors)
        return srgb_to_linear(colors) if self.channels else colors

    def resized(self, long_side: int) -> StoredPhoto:
        """Reduce the photo to a long side, at the same bit depth; return itself if it is small enough."""
        factor = long_side / max(self.size)
        if factor >= 1:
            return self
        width, height = (max(1, round(side * factor)) for side in self.size)
        values = np.nan_to_num(self.pixels.astype(np.float32))
        alpha = values[..., 3:] / white_level(self.pixels) if not (self.is_opaque or self.is_premultiplied) else 1.0
        values[..., :3] *= alpha  # hidden colors of transparent pixels must not count
        small = resize(values, width, height)
        if not (self.is_opaque or self.is_premultiplied):
            small[..., :3] = white_level(self.pixels) * unpremultiply(small / white_level(self.pixels))
        whole = np.rint(small) if self.pixels.dtype.kind == "u" else small
        return replace(self, pixels=whole.astype(self.pixels.dtype))


def open_photo(path: Path, space: ColorSpace | None = None) -> StoredPhoto:
    """Read a photo as stored in its file. Formats and errors are those of `images.read_photo`.

    space: of the file; None: that of its ICC profile, without one sRGB, of EXR linear light with its primaries.
    """
    with decoding(path):
        header = find_header(path)
        if header is not None and header.kind == "exr":
            return StoredPhoto(path, header, *read_light(path, header), space)
    pixels, header = read_pixels(path, upright=False)
    if pixels.dtype.kind == "i":  # Pillow reads 16-bit gray as 32-bit integers
        pixels = np.clip(pixels, 0, 65535).astype(np.uint16)
    elif pixels.dtype == bool:
        pixels = pixels.astype(np.uint8) * 255
    elif pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    if pixels.ndim == 2 or pixels.shape[-1] == 1:
        pixels = np.repeat(np.atleast_3d(pixels), 3, -1)
    return StoredPhoto(path, header, pixels, space=space or embedded_space(path))


def from_camera(grid: np.ndarray, orientation: int) -> np.ndarray:
    """Turn a picture [H, W, ..] from the camera's grid to the stored grid, by `StoredPhoto.orientation_for`."""
    return apply_exif_orientation_copy(grid, INVERSE_EXIF_ORIENTATION.get(orientation, orientation))


def _sum(stored: np.ndarray, difference: np.ndarray) -> np.ndarray:
    if stored.dtype.kind == "u":
        whole = stored + np.rint(difference).astype(np.int32)
        return np.clip(whole, 0, np.iinfo(stored.dtype).max).astype(stored.dtype)
    most = LARGEST_HALF if stored.dtype == np.float16 else np.finfo(np.float32).max
    total = np.clip(stored.astype(np.float64) + difference, -most, most)
    return np.where(difference == 0, stored, total).astype(stored.dtype)


# ------------------------------------------------------------------------------------------------------------- writing
def suffix_for(photo: StoredPhoto, jpeg: bool = False) -> str:
    """Return the suffix of an edited copy: `.png`, `.tif` or `.exr` as the photo's, `.png` for all others.

    jpeg: whether a JPEG stays a JPEG, which changes pixels outside the edit.
    """
    return ".jpg" if jpeg and photo.header.kind == "jpeg" else SUFFIXES.get(photo.header.kind, ".png")


def write_photo(path: Path, photo: StoredPhoto) -> None:
    """Write an edited photo with its file's metadata, atomically, in the stored grid. path: ends by `suffix_for`."""
    write = {".png": _write_png, ".tif": _write_tiff, ".exr": _write_exr, ".jpg": _write_jpeg}[path.suffix]
    atomic_write(path, lambda temporary: write(temporary, photo))


def write_mask(path: Path, mask: np.ndarray, orientation: int) -> None:
    """Write a mask [H, W] of a photo's stored grid as a PNG of 0 and 255, with the photo's Exif orientation."""
    options: dict[str, Any] = {}
    if orientation != 1:
        options["exif"] = Image.Exif()
        options["exif"][ORIENTATION] = orientation
    atomic_write(path, lambda temporary: Image.fromarray(mask).convert("L").save(temporary, **options))


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
    if photo.header.kind == "png":
        content = photo.path.read_bytes()
    else:
        metadata, texts = _metadata(photo), PngImagePlugin.PngInfo()
        if xmp := metadata.pop("xmp", None):
            texts.add_itxt("XML:com.adobe.xmp", xmp)
        stream = io.BytesIO()
        Image.new("RGB", (1, 1)).save(stream, "png", **metadata, pnginfo=texts)
        content = stream.getvalue()
    at = len(PNG_SIGNATURE)
    while at + 8 <= len(content):
        length, kind = struct.unpack_from(">I4s", content, at)
        data = content[at + 8 : at + 8 + length]
        is_gray_profile = kind == b"iCCP" and not _is_rgb(zlib.decompress(data[data.index(b"\0") + 2 :]))
        is_dropped = is_gray_profile or (kind == b"iTXt" and not photo.keeps_xmp)
        if kind in PNG_CHUNKS and not is_dropped:
            yield kind, data
        at += length + 12


def _is_rgb(profile: bytes) -> bool:
    # gray and CMYK profiles do not fit the written pixels
    return profile[16:20] == b"RGB "


def _metadata(photo: StoredPhoto) -> dict[str, Any]:
    """Return profile, Exif, XMP and resolution, as arguments of Pillow's writers."""
    with Image.open(photo.path) as file:
        found = {name: file.info[name] for name in ("icc_profile", "exif", "dpi", "xmp") if file.info.get(name)}
    if not photo.keeps_xmp:
        found.pop("xmp", None)
    if not _is_rgb(found.get("icc_profile", b"")):
        found.pop("icc_profile", None)
    return found


def _write_jpeg(path: Path, photo: StoredPhoto) -> None:
    with Image.open(photo.path) as file:
        sampling = JpegImagePlugin.get_sampling(file)
    metadata = _metadata(photo)
    Image.fromarray(photo.pixels).save(path, quality=JPEG_QUALITY, subsampling=max(sampling, 0), **metadata)


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
    file.seek(0)
    directory = ImageFileDirectory_v2(file.read(8), group=tag)
    file.seek(directory.next if at is None else at)
    directory.load(file)
    return directory


def _tiff_metadata(photo: StoredPhoto) -> ImageFileDirectory_v2:
    kept = ImageFileDirectory_v2()
    with photo.path.open("rb") as file:
        found = _directory(file)
        for tag in TIFF_METADATA:
            if tag not in found or (tag == ICC_PROFILE and not _is_rgb(found[tag])):
                continue
            if tag == XMP and not photo.keeps_xmp:
                continue
            kept.tagtype[tag] = found.tagtype[tag]
            if tag in (EXIF_IFD, GPS_IFD):
                inner = _directory(file, tag, found[tag])
                kept[tag] = {key: value for key, value in inner.items() if key != INTEROPERABILITY_IFD}
            else:
                kept[tag] = found[tag]
    return kept


def _write_exr(path: Path, photo: StoredPhoto) -> None:
    with library_path(photo.path) as readable:
        file = OpenEXR.File(readable)
    header = file.header()
    window, shown = np.array(header["dataWindow"]), np.array(header["displayWindow"])
    width, height = (shown[1] - shown[0] + 1).tolist()
    compression = header["compression"]
    if compression.name in LOSSY_EXR:  # would change pixels outside the edit
        compression = OpenEXR.ZIP_COMPRESSION
    if photo.size != (width, height):  # without the other channels, which have the full size
        reduced = {"RGBA" if photo.pixels.shape[-1] == 4 else "RGB": np.ascontiguousarray(photo.pixels)}
        save_exr(OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, reduced), path)
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
    header["compression"] = compression
    save_exr(file, path)
