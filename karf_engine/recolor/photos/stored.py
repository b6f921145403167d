"""A photo as stored in its file, with access to its sRGB colors.

The stored grid is that of the file before its Exif orientation is applied. Values that no edit changes are never
converted, so that an edited copy has the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ...capture.camera import Camera, wrong_size_error
from ...io.color import srgb_to_linear, to_bytes
from ...io.color_spaces import ColorSpace
from ...io.image_size import ImageHeader, find_header
from ...io.images import (
    INVERSE_EXIF_ORIENTATION,
    alpha_composite,
    apply_exif_orientation_copy,
    convert_to_srgb,
    decoding,
    display_colors,
    read_light,
    read_pixels,
    resize,
    unpremultiply,
    white_level,
)

WHOLE = slice(None)
LARGEST_HALF = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class StoredPhoto:
    """A photo's stored pixels.

    Attributes:
        path: The file.
        header: Of the file.
        pixels: [H, W, 3 or 4], of an EXR also 1: uint8, uint16, float32 or float16, in the stored grid. EXR: linear
            light with premultiplied alpha, on the display window. Others: sRGB, gray and palettes as three channels.
        channels: Name of an EXR's channels; else empty.
        space: Color space of the stored colors; None: as above.
    """

    path: Path
    header: ImageHeader
    pixels: np.ndarray
    channels: str = ""
    space: ColorSpace | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the stored grid."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def is_light(self) -> bool:
        """True if the pixels are linear light."""
        return bool(self.channels)

    @property
    def is_premultiplied(self) -> bool:
        """True if colors are stored with premultiplied alpha."""
        return self.pixels.shape[-1] == 4 and self.header.deep and self.header.premultiplied

    @cached_property
    def is_opaque(self) -> bool:
        """True if alpha is 1 everywhere."""
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
        if self.is_light:
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
        return srgb_to_linear(colors) if self.is_light else colors

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
    """Read a photo as stored in its file.

    Args:
        path: PNG, JPEG, WebP, TIFF, BMP, EXR, or another format of `images.read_photo`.
        space: Color space of the file; None: sRGB, of EXR linear light with its primaries.

    Raises:
        DataError: As `images.read_photo`.
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
    return StoredPhoto(path, header, pixels, space=space)


def from_camera(grid: np.ndarray, orientation: int) -> np.ndarray:
    """Turn a picture [H, W, ..] from the camera's grid to the stored grid; see `StoredPhoto.orientation_for`."""
    return apply_exif_orientation_copy(grid, INVERSE_EXIF_ORIENTATION.get(orientation, orientation))


def _sum(stored: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Add a difference to stored values, in the stored type."""
    if stored.dtype.kind == "u":
        whole = stored + np.rint(difference).astype(np.int32)
        return np.clip(whole, 0, np.iinfo(stored.dtype).max).astype(stored.dtype)
    most = LARGEST_HALF if stored.dtype == np.float16 else np.finfo(np.float32).max
    total = np.clip(stored.astype(np.float64) + difference, -most, most)
    return np.where(difference == 0, stored, total).astype(stored.dtype)
