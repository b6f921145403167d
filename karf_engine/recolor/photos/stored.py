"""A photo as its file holds it: every stored value, in the stored grid, and what it looks like to the engine.

The stored grid is that of the file before its Exif orientation is followed. Values that no edit reaches are never
converted, so that an edited copy has them to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ...capture.camera import Camera, wrong_size
from ...io.color import srgb_to_linear, to_bytes
from ...io.color_spaces import ColorSpace
from ...io.image_size import ImageHeader, find_header
from ...io.images import (
    BACK,
    decoding,
    display_colors,
    full_value,
    in_srgb,
    oriented,
    over,
    read_light,
    read_pixels,
    resize,
    straight,
)

WHOLE = slice(None)
LARGEST_HALF = float(np.finfo(np.float16).max)


@dataclass(frozen=True)
class StoredPhoto:
    """A photo's stored pixels and what is needed to write an edited copy of the file.

    Attributes:
        path: The file.
        header: Its header.
        pixels: [H, W, 3 or 4], of an EXR also 1: uint8, uint16, float32 or float16, in the stored grid. EXR: linear
            light with premultiplied alpha, on the display window. Others: sRGB, gray and palettes as three channels.
        channels: Name of the channels that an EXR holds them in; else empty.
        space: That the stored colors are in; None: as above.
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
        """Whether the pixels hold linear light."""
        return bool(self.channels)

    @property
    def is_premultiplied(self) -> bool:
        """Whether colors are stored times alpha."""
        return self.pixels.shape[-1] == 4 and self.header.deep and self.header.premultiplied

    @cached_property
    def is_opaque(self) -> bool:
        """Whether no pixel shows what is behind the photo."""
        return self.pixels.shape[-1] < 4 or bool((self.pixels[..., 3] >= full_value(self.pixels)).all())

    def orientation_for(self, camera: Camera) -> int:
        """Exif orientation between the stored grid and the camera's, which knows the photo upright or as stored.

        Raises:
            DataError: The camera is of another size.
        """
        known = (camera.width, camera.height)
        width, height = self.size
        if known == ((height, width) if self.header.swaps_sides else self.size):
            return self.header.orientation
        if known == self.size:
            return 1
        raise wrong_size(self.path, width, height, camera)

    def colors(self, rows: slice = WHOLE, columns: slice = WHOLE) -> np.ndarray:
        """What the engine sees of some pixels: straight sRGB, float32 [h, w, 3] in [0, 1]."""
        stored = self.pixels[rows, columns]
        if self.is_light:
            return display_colors(stored.astype(np.float32), self.space)[..., :3]
        values = np.clip(stored.astype(np.float32) / full_value(stored), 0, 1)
        colors = straight(values) if self.is_premultiplied else values[..., :3]
        return colors if self.space is None else in_srgb(colors, self.space)

    def alpha(self, rows: slice = WHOLE, columns: slice = WHOLE) -> np.ndarray | None:
        """Alpha of some pixels, float32 [h, w] in [0, 1]; None where the whole photo is opaque."""
        if self.is_opaque:
            return None
        stored = self.pixels[rows, columns, 3]
        return np.clip(stored.astype(np.float32) / full_value(stored), 0, 1)

    def shown(self, rows: slice = WHOLE, columns: slice = WHOLE) -> np.ndarray:
        """Some pixels as a matte capture shows them, on white: uint8 sRGB [h, w, 3]."""
        stored = self.pixels[rows, columns]
        if stored.dtype == np.uint8 and self.is_opaque and self.space is None:
            return stored[..., :3]
        return to_bytes(over(self.colors(rows, columns), self.alpha(rows, columns)))

    def copy(self) -> StoredPhoto:
        """The same photo with pixels of its own, gray ones as colors."""
        channels = max(3, self.pixels.shape[-1])
        return replace(self, pixels=np.array(np.broadcast_to(self.pixels, (*self.pixels.shape[:2], channels))))

    def change(self, rows: slice, columns: slice, change: np.ndarray) -> None:
        """Add a change [h, w, 3] of the straight sRGB colors to some pixels, in place.

        Pixels whose change is zero keep their bits. So does all light above one: the edit is added to what is shown.
        """
        touched = change.any(-1)
        stored = self.pixels[rows, columns]
        before = self.colors(rows, columns)[touched]
        after = np.clip(before + change[touched], 0, 1)
        difference = (self._stored_colors(after) - self._stored_colors(before)) * full_value(stored)
        if self.is_premultiplied:
            difference = difference * np.clip(stored[touched][:, 3:].astype(np.float32) / full_value(stored), 0, 1)
        stored[..., :3][touched] = _sum(stored[..., :3][touched], difference)

    def _stored_colors(self, colors: np.ndarray) -> np.ndarray:
        """sRGB colors [n, 3] as the file has them, its full value being 1."""
        if self.space is not None:
            return self.space.from_srgb(colors)
        return srgb_to_linear(colors) if self.is_light else colors

    def resized(self, long_side: int) -> StoredPhoto:
        """The photo reduced so that no side is longer, as deep as it is; itself where it is small enough."""
        factor = long_side / max(self.size)
        if factor >= 1:
            return self
        width, height = (max(1, round(side * factor)) for side in self.size)
        values = np.nan_to_num(self.pixels.astype(np.float32))
        alpha = values[..., 3:] / full_value(self.pixels) if not (self.is_opaque or self.is_premultiplied) else 1.0
        values[..., :3] *= alpha  # averages must not mix in the hidden colors of transparent pixels
        small = resize(values, width, height)
        if not (self.is_opaque or self.is_premultiplied):
            small[..., :3] = full_value(self.pixels) * straight(small / full_value(self.pixels))
        whole = np.rint(small) if self.pixels.dtype.kind == "u" else small
        return replace(self, pixels=whole.astype(self.pixels.dtype))


def open_photo(path: Path, space: ColorSpace | None = None) -> StoredPhoto:
    """Read a photo as its file holds it.

    Args:
        path: PNG, JPEG, WebP, TIFF, BMP, EXR, or what else `images.read_photo` reads.
        space: That its colors are in; None: sRGB, of EXR linear light with its primaries.

    Raises:
        DataError: As `images.read_photo`.
    """
    with decoding(path):
        header = find_header(path)
        if header is not None and header.kind == "exr":
            return StoredPhoto(path, header, *read_light(path, header), space)
    pixels, header = read_pixels(path, upright=False)
    if pixels.dtype.kind == "i":  # Pillow's 32-bit integers hold 16-bit gray
        pixels = np.clip(pixels, 0, 65535).astype(np.uint16)
    elif pixels.dtype == bool:
        pixels = pixels.astype(np.uint8) * 255
    elif pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    if pixels.ndim == 2 or pixels.shape[-1] == 1:
        pixels = np.repeat(np.atleast_3d(pixels), 3, -1)
    return StoredPhoto(path, header, pixels, space=space)


def from_camera(grid: np.ndarray, orientation: int) -> np.ndarray:
    """A picture [H, W, ..] of the camera's grid in the stored grid; see `StoredPhoto.orientation_for`."""
    return oriented(grid, BACK.get(orientation, orientation))


def _sum(stored: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """Stored values plus a difference, in the stored type, where it is not zero after rounding."""
    if stored.dtype.kind == "u":
        whole = stored + np.rint(difference).astype(np.int32)
        return np.clip(whole, 0, np.iinfo(stored.dtype).max).astype(stored.dtype)
    most = LARGEST_HALF if stored.dtype == np.float16 else np.finfo(np.float32).max
    total = np.clip(stored.astype(np.float64) + difference, -most, most)
    return np.where(difference == 0, stored, total).astype(stored.dtype)
