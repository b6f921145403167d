"""Image files in and out, and resizing (rounding to 8 bit is `color.to_bytes`).

Images are float32 [H, W, C], display-referred sRGB in [0, 1], row 0 at the top. Pixel corners lie at integers, so the
value at [row, column] belongs to the position (u, v) = (column + 0.5, row + 0.5). Alpha is straight, not multiplied in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import imageio.v3 as iio
import numpy as np
import OpenEXR
from PIL import Image

from ..errors import KarfError
from .color import linear_to_srgb, to_bytes
from .color_spaces import ColorSpace
from .failures import is_out_of_memory
from .files import atomic_write
from .image_size import MOST_PIXELS, MOST_PIXELS_OF_SMALL, ImageHeader, check_pixels, find_header, unreadable

MOST_PIXELS_OF_SMALL_EXR = 8_000_000  # pixels of up to four channels: each takes several copies of floats
ROWS = 256  # that are converted together
BACK = {6: 8, 8: 6}  # the Exif orientation that undoes another; all others undo themselves
MOST_PIXELS_OF_SMALL_MASK = 100_000_000  # pixels of drawings, which compress well

Image.MAX_IMAGE_PIXELS = MOST_PIXELS  # sizes are checked here, before a picture is decoded
cv2.setNumThreads(1)  # its threads would fight torch's for the same cores
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what matters becomes a DataError


def read_photo(path: Path, upright: bool = True, space: ColorSpace | None = None) -> np.ndarray:
    """Read a picture of any kind that Pillow, OpenCV or OpenEXR reads.

    Gray and palette pictures become RGB; 16-bit pictures keep their depth. EXR files hold linear light with
    premultiplied alpha: they become sRGB, clipped, with straight alpha, as large as their display window.

    Args:
        path: The file.
        upright: Whether to apply its Exif orientation.
        space: That the file's colors are in; None: sRGB, of EXR linear light with its primaries.

    Returns:
        sRGB float32 [H, W, 3 or 4] in [0, 1]; alpha is straight.

    Raises:
        DataError: The file is missing, damaged, not a picture, or claims more pixels than are read.
    """
    pixels, header = read_pixels(path, upright, space=space)
    colors = _as_colors(pixels)
    is_premultiplied = header.premultiplied and header.kind == "tiff" and header.deep  # Pillow divides by itself
    if is_premultiplied and colors.shape[-1] == 4:
        colors[..., :3] = straight(colors)
    if space is not None and header.kind != "exr":  # whose light is converted where it is read
        colors[..., :3] = in_srgb(colors[..., :3], space)
    return colors


def in_srgb(colors: np.ndarray, space: ColorSpace) -> np.ndarray:
    """sRGB [..., 3] in [0, 1], clipped, of colors in a space."""
    return np.clip(space.to_srgb(colors), 0, 1)


def read_pixels(
    path: Path, upright: bool, of_small: int = MOST_PIXELS_OF_SMALL, space: ColorSpace | None = None
) -> tuple[np.ndarray, ImageHeader]:
    """Pixels as deep as they are stored; of EXR display colors.

    Args:
        path: The file.
        upright: Whether to apply its Exif orientation.
        of_small: How many pixels are read of the smallest file.
        space: That the light of an EXR is in; other pixels stay as they are stored.

    Returns:
        Pixels [H, W] or [H, W, C], and the file's header.

    Raises:
        DataError: As `read_photo`.
    """
    with decoding(path):
        header = find_header(path) or ImageHeader(0, 0)  # Pillow knows more kinds than `find_header`
        check_pixels(path, *header.stored, of_small, header.depth)
        if header.kind == "exr":
            return _read_exr(path, header, space), header
        pixels = _read_deep(path) if header.deep else _read_plain(path, upright, of_small)
    if header.kind == "tiff":  # decoders always turn these
        orientation = 1 if upright else BACK.get(header.orientation, header.orientation)
    else:
        orientation = header.orientation if header.deep and upright else 1
    return oriented(pixels, orientation), header


@contextmanager
def decoding(path: Path) -> Iterator[None]:
    """What a decoder raises in the body becomes a DataError that names the file."""
    try:
        yield
    except Exception as error:  # damaged files make decoders raise nearly anything
        if isinstance(error, KarfError | PermissionError) or is_out_of_memory(error):
            raise
        raise unreadable(path, str(error) or type(error).__name__) from error


def _read_plain(path: Path, upright: bool, of_small: int) -> np.ndarray:
    with iio.imopen(path.read_bytes(), "r", plugin="pillow") as file:
        stored = file.metadata(index=0)
        check_pixels(path, *stored["shape"], of_small)
        return file.read(index=0, mode=_mode_to_read(stored), rotate=upright)


def _read_deep(path: Path) -> np.ndarray:
    """Colors of more than 8 bits, which Pillow would cut to 8."""
    pixels = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("OpenCV cannot decode it")
    if pixels.ndim == 3:  # blue first; in place, since a copy of a large picture is much
        blue = pixels[..., 0].copy()
        pixels[..., 0], pixels[..., 2] = pixels[..., 2], blue
    return pixels


def oriented(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Stored pixels [H, W, ..] as a viewer shows them (Exif 2.3, tag 0x0112)."""
    return np.ascontiguousarray(turned(pixels, orientation))


def turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """The same without a copy: what is written there is written to the stored pixels."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels


def _read_exr(path: Path, header: ImageHeader, space: ColorSpace | None) -> np.ndarray:
    return display_colors(read_light(path, header)[0].astype(np.float32, copy=False), space)


def read_light(path: Path, header: ImageHeader) -> tuple[np.ndarray, str]:
    """Linear light of an EXR file on its display window, and the name of the channels that hold it.

    Args:
        path: The file.
        header: Its header.

    Returns:
        [H, W, 1, 3 or 4] as deep as it is stored, premultiplied; and the name, for example `RGBA`.

    Raises:
        DataError: The file claims more pixels than are read.
        ValueError: It holds no colors.
    """
    for part in OpenEXR.File(str(path), header_only=True).parts:
        first, last = part.header["dataWindow"]
        width, height = (last.astype(int) - first + 1).tolist()
        layers = math.ceil(len(part.header["channels"]) / 4)
        for size in ((width, height * layers), header.stored):
            check_pixels(path, *size, MOST_PIXELS_OF_SMALL_EXR)
    file = OpenEXR.File(str(path))
    channels = {name: channel.pixels for name, channel in file.channels().items()}
    layers = [name for name, pixels in channels.items() if pixels.ndim == 3]
    name = next((name for name in ("RGBA", "RGB", "Y", *layers) if name in channels), None)
    if name is None:
        raise ValueError(f"it has no colors among its channels {', '.join(channels)}")
    stored = np.atleast_3d(channels[name])
    light = np.zeros((header.height, header.width, stored.shape[-1]), stored.dtype)
    paste(stored, light, file.header()["dataWindow"][0] - file.header()["displayWindow"][0])
    return light, name


def display_colors(light: np.ndarray, space: ColorSpace | None = None) -> np.ndarray:
    """sRGB float32 [H, W, 3 or 4], clipped, with straight alpha, of premultiplied float32 light [H, W, 1, 3 or 4].

    space: that the light is in; None: linear, with the primaries of sRGB.
    """
    shown = np.empty((*light.shape[:2], max(3, light.shape[-1])), np.float32)
    for start in range(0, len(light), ROWS):  # the curve is computed in double precision: of a whole picture too much
        shown[start : start + ROWS] = _display_colors(light[start : start + ROWS], space)
    return shown


def _display_colors(light: np.ndarray, space: ColorSpace | None) -> np.ndarray:
    light = np.nan_to_num(light, posinf=np.finfo(np.float32).max)
    if light.shape[-1] == 4:
        light[..., :3] = straight(light)
    colors = light[..., :3] if light.shape[-1] > 1 else np.repeat(light, 3, -1)
    colors = np.clip(linear_to_srgb(np.clip(colors, 0, 1)), 0, 1) if space is None else in_srgb(colors, space)
    return np.concatenate([colors, np.clip(light[..., 3:], 0, 1)], -1)


def paste(stored: np.ndarray, canvas: np.ndarray, corner: np.ndarray) -> None:
    """Copy the part of `stored` that lies on the canvas, its first pixel at `corner` (column, row)."""
    left, top = map(int, corner)
    stored = stored[max(0, -top) :, max(0, -left) :]
    place = canvas[max(0, top) :, max(0, left) :]
    height, width = min(len(stored), len(place)), min(stored.shape[1], place.shape[1])
    place[:height, :width] = stored[:height, :width]


def _mode_to_read(stored: dict[str, Any]) -> str | None:
    """Pillow's mode to convert a picture to, of its metadata; None keeps gray ones as deep as they are."""
    if stored["mode"] in ("LA", "PA", "RGBA") or "transparency" in stored:
        return "RGBA"
    is_gray = stored["mode"] in ("1", "L", "F") or stored["mode"].startswith("I")
    return None if is_gray else "RGB"


def _as_colors(pixels: np.ndarray) -> np.ndarray:
    colors = pixels.astype(np.float32, copy=not pixels.flags.writeable)
    colors /= full_value(pixels)
    np.clip(colors, 0, 1, out=colors)
    return colors if colors.ndim == 3 else np.repeat(colors[..., None], 3, axis=-1)


def full_value(pixels: np.ndarray) -> int:
    """The stored value of full brightness."""
    return 255 if pixels.dtype == np.uint8 else 65535 if pixels.dtype.kind in "ui" else 1


def write_png(path: Path, array: np.ndarray) -> None:
    """Write a PNG, atomically.

    Args:
        path: The file.
        array: [H, W] or [H, W, 1, 3 or 4]. Float in [0, 1] is clipped and rounded to 8 bit, bool becomes 0 and 255,
            uint8 is kept, uint16 [H, W] (depth) becomes 16-bit gray.

    Raises:
        TypeError: The array is of another kind.
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


def encoded(suffix: str, pixels: np.ndarray, options: Sequence[int] = ()) -> memoryview:
    """A picture file of pixels [H, W, 3 or 4] by OpenCV, which wants blue first; options: its flags and their values.

    Raises OSError where this kind of file cannot hold them.
    """
    order = cv2.COLOR_RGBA2BGRA if pixels.shape[-1] == 4 else cv2.COLOR_RGB2BGR
    done, content = cv2.imencode(suffix, cv2.cvtColor(pixels, order), options)
    if not done:
        raise OSError(f"OpenCV cannot encode {pixels.dtype} {pixels.shape} as {suffix}.")
    return content.data


def read_mask(path: Path) -> np.ndarray:
    """Read a mask: what is over one half in alpha where that varies, else in the brightest channel.

    A file whose only values are 0 and 1 (of 255) is read as a label image.

    Args:
        path: The file, of any kind that `read_photo` reads.

    Returns:
        bool [H, W], True inside.

    Raises:
        DataError: As `read_photo`.
    """
    pixels, _ = read_pixels(path, True, MOST_PIXELS_OF_SMALL_MASK)  # no floats: masks of large photos are small files
    pixels = np.atleast_3d(pixels)
    full = full_value(pixels)
    color = pixels[..., :3].max(-1)
    brightest = color.max()
    inside = color > (full / 2 if brightest > 1.5 / 255 * full else brightest / 2)
    if pixels.shape[-1] < 4:
        return inside
    opaque = pixels[..., 3] > full / 2
    # a cut-out may have any color; a mask saved with a flat alpha channel has its shape in the color
    return opaque if opaque.any() and not opaque.all() else inside & opaque


def resize(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize by exact area averaging along an axis that shrinks, linear interpolation along an axis that grows.

    Args:
        image: Float [H, W] or [H, W, C].
        width: Pixels.
        height: Pixels.

    Returns:
        float32 [height, width] or [height, width, C].

    Examples:
        >>> resize(np.array([[0.0, 1.0, 3.0, 4.0]]), 2, 1).tolist()
        [[0.5, 3.5]]
    """
    resized = image.astype(np.float32, copy=False)
    smaller = (min(width, image.shape[1]), min(height, image.shape[0]))
    for size, method in ((smaller, cv2.INTER_AREA), ((width, height), cv2.INTER_LINEAR)):
        if size != resized.shape[1::-1]:
            resized = cv2.resize(resized, size, interpolation=method)
    return resized.reshape(height, width, *image.shape[2:])


def over(colors: np.ndarray, alpha: np.ndarray | None, gray: float = 1.0) -> np.ndarray:
    """Straight colors [H, W, 3] with alpha [H, W] on a gray, by default white; as they are where alpha is None.

    Examples:
        >>> over(np.array([[[1.0, 0.0, 0.0]]]), np.array([[0.5]])).tolist()
        [[[1.0, 0.5, 0.5]]]
    """
    return colors if alpha is None else colors * alpha[..., None] + gray * (1 - alpha[..., None])


def straight(photo: np.ndarray) -> np.ndarray:
    """Straight colors [H, W, 3] of premultiplied [H, W, 4], all in [0, 1]; black where alpha is 0."""
    alpha = photo[..., 3:]
    color = np.divide(photo[..., :3], alpha, out=np.zeros_like(photo[..., :3]), where=alpha > 0)
    return np.minimum(color, 1.0)  # the quotient may round to above one
