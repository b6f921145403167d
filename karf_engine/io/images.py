"""Read and write image files, and resize images.

Images are float32 [H, W, C], display-referred sRGB in [0, 1], row 0 at the top, with straight alpha. Pixel corners are at
integers: the value at [row, column] is at position (u, v) = (column + 0.5, row + 0.5).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import cv2
import imageio.v3 as iio
import numpy as np
import OpenEXR
import pillow_heif
from PIL import Image, ImageOps

from ..errors import KarfError
from . import icc
from .color import linear_to_srgb, to_bytes
from .color_spaces import ColorSpace
from .failures import is_out_of_memory
from .files import atomic_write, library_path
from .image_size import (
    MOST_PIXELS,
    MOST_PIXELS_OF_SMALL,
    ImageHeader,
    check_pixels,
    find_header,
    unreadable_image_error,
)

MOST_PIXELS_OF_SMALL_EXR = 8_000_000  # fewer, because floats are copied several times
ROWS = 256  # rows converted at a time
INTEROPERABILITY_IFD = 0xA005
INVERSE_EXIF_ORIENTATION = {6: 8, 8: 6}  # inverse Exif orientations; all others are their own inverse
MOST_PIXELS_OF_SMALL_MASK = 100_000_000  # more, because drawings compress well

Image.MAX_IMAGE_PIXELS = MOST_PIXELS  # `check_pixels` comes first
pillow_heif.register_heif_opener()
cv2.setNumThreads(1)  # its threads would compete with torch's
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def read_photo(
    path: Path, upright: bool = True, space: ColorSpace | None = None, by_profile: bool = True
) -> np.ndarray:
    """Read an image of any kind that Pillow, OpenCV or OpenEXR reads.

    Gray and palette images become RGB; 16-bit images keep their precision. EXR files, which hold premultiplied linear light,
    become clipped sRGB on their display window. `upright` applies the Exif orientation. `space` is that of the file; None:
    that of its ICC profile, without one sRGB, for EXR linear light with its primaries. Without `by_profile` the colors stay
    in `embedded_space(path)`, for callers that convert them after making the photo smaller.

    Returns sRGB float32 [H, W, 3 or 4] in [0, 1] with straight alpha. Raises DataError if the file is missing, damaged, not
    an image or too large.
    """
    pixels, header = read_pixels(path, upright, space=space)
    colors = _as_colors(pixels)
    is_premultiplied = header.premultiplied and header.kind == "tiff" and header.deep  # Pillow unpremultiplies itself
    if is_premultiplied and colors.shape[-1] == 4:
        colors[..., :3] = unpremultiply(colors)
    if header.kind == "exr":  # its colors are converted already
        return colors
    own_space = space or (embedded_space(path) if by_profile else None)
    if own_space is not None:
        for start in range(0, len(colors), ROWS):  # in blocks, because curves are computed in double precision
            colors[start : start + ROWS, :, :3] = convert_to_srgb(colors[start : start + ROWS, :, :3], own_space)
    return colors


def embedded_space(path: Path) -> icc.Space | None:
    """Return the RGB space that an image file declares by an ICC profile or by Exif; None if it is sRGB or none."""
    try:
        with Image.open(path) as image:
            if profile := image.info.get("icc_profile"):
                return icc.profile_space(profile) if image.mode not in ("L", "LA", "CMYK") else None
            interoperability = image.getexif().get_ifd(INTEROPERABILITY_IFD) if "exif" in image.info else {}
    except Exception as error:  # decoders raise nearly anything for damaged metadata
        if is_out_of_memory(error):
            raise
        return None
    return icc.adobe_rgb() if interoperability.get(1) == "R03" else None


def convert_to_srgb(colors: np.ndarray, space: ColorSpace | icc.Space) -> np.ndarray:
    """Convert colors of a space to sRGB clipped to [0, 1]."""
    return np.clip(space.to_srgb(colors), 0, 1)


def read_pixels(
    path: Path, upright: bool, min_pixel_limit: int = MOST_PIXELS_OF_SMALL, space: ColorSpace | None = None
) -> tuple[np.ndarray, ImageHeader]:
    """Read pixels [H, W] or [H, W, C] at their stored depth, and the header; EXR files as display colors in `space`.

    `min_pixel_limit` is that of `check_pixels`. Raises DataError as `read_photo`.
    """
    with decoding(path):
        header = find_header(path) or ImageHeader(0, 0)  # Pillow knows more kinds than `find_header`
        check_pixels(path, *header.stored_size, min_pixel_limit, header.depth)
        if header.kind == "exr":
            return display_colors(read_light(path, header)[0].astype(np.float32, copy=False), space), header
        pixels = _read_deep(path) if header.deep else _read_plain(path, upright, min_pixel_limit)
    if header.kind == "tiff":  # decoders apply its orientation always
        orientation = 1 if upright else INVERSE_EXIF_ORIENTATION.get(header.orientation, header.orientation)
    else:
        orientation = header.orientation if header.deep and upright else 1
    return apply_exif_orientation_copy(pixels, orientation), header


@contextmanager
def decoding(path: Path) -> Iterator[None]:
    """Raise errors of a decoder in the block as DataError that names the file."""
    try:
        yield
    except Exception as error:  # decoders raise nearly anything for damaged files
        if isinstance(error, KarfError | PermissionError) or is_out_of_memory(error):
            raise
        raise unreadable_image_error(path, str(error) or type(error).__name__) from error


def _read_plain(path: Path, upright: bool, min_pixel_limit: int) -> np.ndarray:
    with iio.imopen(path.read_bytes(), "r", plugin="pillow") as file:
        stored = file.metadata(index=0)
        width, height = stored["shape"]
        check_pixels(path, width, height, min_pixel_limit)
        if stored["mode"] in ("L", "CMYK") and stored.get("icc_profile"):
            return _read_by_profile(path, upright)
        return cast(Any, file).read(index=0, mode=_mode_to_read(stored), rotate=upright)


def _read_by_profile(path: Path, upright: bool) -> np.ndarray:
    """Read a gray or CMYK image as sRGB, uint8 [H, W, 3]."""
    with Image.open(path) as image:
        converted = icc.convert_image(image, image.info["icc_profile"])
        return np.array(ImageOps.exif_transpose(image=converted) if upright else converted)


def _read_deep(path: Path) -> np.ndarray:
    """Read colors of more than 8 bits, which Pillow would reduce to 8."""
    pixels = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("OpenCV cannot decode it")
    if pixels.ndim == 3:  # BGR to RGB, in place to save memory
        blue = pixels[..., 0].copy()
        pixels[..., 0], pixels[..., 2] = pixels[..., 2], blue
    return pixels


def apply_exif_orientation_copy(pixels: np.ndarray, orientation: int) -> np.ndarray:
    return np.ascontiguousarray(apply_exif_orientation(pixels, orientation))


def apply_exif_orientation(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Apply an Exif orientation as a view of the same memory."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels


def read_light(path: Path, header: ImageHeader) -> tuple[np.ndarray, str]:
    """Read the premultiplied linear light [H, W, 1, 3 or 4] of an EXR file on its display window, and its layer's name.

    Raises DataError if the file claims too many pixels, ValueError if it has no colors.
    """
    with library_path(path) as readable:
        parts = OpenEXR.File(readable, header_only=True).parts
    for part in parts:
        first, last = part.header["dataWindow"]
        width, height = (last.astype(int) - first + 1).tolist()
        layers = math.ceil(len(part.header["channels"]) / 4)
        for size in ((width, height * layers), header.stored_size):
            check_pixels(path, *size, MOST_PIXELS_OF_SMALL_EXR)
    with library_path(path) as readable:
        file = OpenEXR.File(readable)
    channels = {name: channel.pixels for name, channel in file.channels().items()}
    layers = [name for name, pixels in channels.items() if pixels.ndim == 3]
    name = next((name for name in ("RGBA", "RGB", "Y", *layers) if name in channels), None)
    if name is None:
        raise ValueError(f"it has no colors among its channels {', '.join(channels)}")
    stored = np.atleast_3d(channels[name])
    light = np.zeros((header.height, header.width, stored.shape[-1]), stored.dtype)
    paste(stored, light, file.header()["dataWindow"][0] - file.header()["displayWindow"][0])
    return light, name


def display_colors(light: np.ndarray, space: ColorSpace | icc.Space | None = None) -> np.ndarray:
    """Convert premultiplied light float32 [H, W, 1, 3 or 4] to clipped sRGB float32 [H, W, 3 or 4] with straight alpha.

    A `space` of None is linear light with the primaries of sRGB.
    """
    colors = np.empty((*light.shape[:2], max(3, light.shape[-1])), np.float32)
    for start in range(0, len(light), ROWS):  # in blocks, because the sRGB curve is computed in double precision
        colors[start : start + ROWS] = _display_colors(light[start : start + ROWS], space)
    return colors


def _display_colors(light: np.ndarray, space: ColorSpace | icc.Space | None) -> np.ndarray:
    light = np.nan_to_num(light, posinf=float(np.finfo(np.float32).max))
    if light.shape[-1] == 4:
        light[..., :3] = unpremultiply(light)
    colors = light[..., :3] if light.shape[-1] > 1 else np.repeat(light, 3, -1)
    colors = np.clip(linear_to_srgb(np.clip(colors, 0, 1)), 0, 1) if space is None else convert_to_srgb(colors, space)
    return np.concatenate([colors, np.clip(light[..., 3:], 0, 1)], -1)


def paste(stored: np.ndarray, canvas: np.ndarray, corner: np.ndarray) -> None:
    """Copy `stored` onto the canvas with its first pixel at `corner` (column, row), cropped to the canvas."""
    left, top = map(int, corner)
    stored = stored[max(0, -top) :, max(0, -left) :]
    place = canvas[max(0, top) :, max(0, left) :]
    height, width = min(len(stored), len(place)), min(stored.shape[1], place.shape[1])
    place[:height, :width] = stored[:height, :width]


def _mode_to_read(stored: dict[str, Any]) -> str | None:
    """Return the mode for Pillow to convert to; None keeps the depth of gray images."""
    if stored["mode"] in ("LA", "PA", "RGBA") or "transparency" in stored:
        return "RGBA"
    is_gray = stored["mode"] in ("1", "L", "F") or stored["mode"].startswith("I")
    return None if is_gray else "RGB"


def _as_colors(pixels: np.ndarray) -> np.ndarray:
    colors = pixels.astype(np.float32, copy=not pixels.flags.writeable)
    colors /= white_level(pixels)
    np.clip(colors, 0, 1, out=colors)
    return colors if colors.ndim == 3 else np.repeat(colors[..., None], 3, axis=-1)


def white_level(pixels: np.ndarray) -> int:
    """Return the stored value of full brightness."""
    return 255 if pixels.dtype == np.uint8 else 65535 if pixels.dtype.kind in "ui" else 1


def write_png(path: Path, array: np.ndarray) -> None:
    """Write an array [H, W] or [H, W, 1, 3 or 4] as PNG, atomically. Raises TypeError for other arrays.

    Floats in [0, 1] are clipped and rounded to 8 bits, bool becomes 0 and 255; uint8 and uint16 [H, W] are unchanged.
    """
    if np.issubdtype(array.dtype, np.floating):
        array = to_bytes(array)
    elif array.dtype == bool:
        array = array.astype(np.uint8) * 255
    if array.dtype not in (np.uint8, np.uint16) or (array.dtype == np.uint16 and array.squeeze().ndim != 2):
        raise TypeError(f"a PNG cannot hold an array of {array.dtype} {array.shape}")
    if array.ndim == 3 and array.shape[-1] == 1:
        array = array[..., 0]
    atomic_write(path, lambda file: iio.imwrite(file, array, plugin="pillow", extension=".png", is_batch=False))


def encode_image(suffix: str, pixels: np.ndarray, options: Sequence[int] = ()) -> memoryview:
    """Encode RGB or RGBA pixels as an image file, by OpenCV with its flags. Raises OSError if the format cannot hold them."""
    order = cv2.COLOR_RGBA2BGRA if pixels.shape[-1] == 4 else cv2.COLOR_RGB2BGR
    done, content = cv2.imencode(suffix, cv2.cvtColor(pixels, order), options)
    if not done:
        raise OSError(f"OpenCV cannot encode {pixels.dtype} {pixels.shape} as {suffix}.")
    return content.data


def save_exr(file: OpenEXR.File, path: Path) -> None:
    """Write an EXR file. Raises RuntimeError if it cannot be written."""
    with library_path(path) as writable:
        file.write(writable)


def read_mask(path: Path) -> np.ndarray:
    """Read a mask by thresholding alpha at one half where it varies, else the brightest channel; bool [H, W].

    A file with the values 0 and 1 (of 255) only is a label image: 1 is inside. Raises DataError as `read_photo`.
    """
    pixels, _ = read_pixels(path, True, MOST_PIXELS_OF_SMALL_MASK)
    pixels = np.atleast_3d(pixels)  # kept as integers to save memory
    full = white_level(pixels)
    color = pixels[..., :3].max(-1)
    brightest = color.max()
    inside = color > (full / 2 if brightest > 1.5 / 255 * full else brightest / 2)
    if pixels.shape[-1] < 4:
        return inside
    opaque = pixels[..., 3] > full / 2
    # a cut-out has its shape in alpha; a mask saved with constant alpha has it in the colors
    return opaque if opaque.any() and not opaque.all() else inside & opaque


def resize(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize [H, W, ...] by exact area averaging along axes that shrink and linear interpolation along axes that grow."""
    resized = image.astype(np.float32, copy=False)
    smaller = (min(width, image.shape[1]), min(height, image.shape[0]))
    for size, method in ((smaller, cv2.INTER_AREA), ((width, height), cv2.INTER_LINEAR)):
        if size != resized.shape[1::-1]:
            resized = cv2.resize(resized, size, interpolation=method)
    return resized.reshape(height, width, *image.shape[2:])


def alpha_composite(colors: np.ndarray, alpha: np.ndarray | None, gray: float = 1.0) -> np.ndarray:
    """Composite straight colors [H, W, 3] with alpha [H, W] over a gray; unchanged if alpha is None."""
    return colors if alpha is None else colors * alpha[..., None] + gray * (1 - alpha[..., None])


def unpremultiply(photo: np.ndarray) -> np.ndarray:
    """Unpremultiply [H, W, 4] to straight colors [H, W, 3], all in [0, 1]; black where alpha is 0."""
    alpha = photo[..., 3:]
    color = np.divide(photo[..., :3], alpha, out=np.zeros_like(photo[..., :3]), where=alpha > 0)
    return np.minimum(color, 1.0)  # rounding may exceed one
