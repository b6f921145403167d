"""Pixels between numpy ([H, W, channels] float32 sRGB in [0, 1], first row at the top) and Blender's images.

These are opaque byte images labelled sRGB, whose numbers every Blender version keeps. No other module touches pixels.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .. import session
from ..engine_api import DataError, atomic_write
from ..host import rendering

STILL_SECONDS = 0.5  # that a picture has not changed: one that follows the mouse is not packed at every step


def new_image(name: str, width: int, height: int) -> bpy.types.Image:
    """Create a black, opaque byte image labelled sRGB; raise BadRequest while Blender renders."""
    rendering.refuse()
    image = bpy.data.images.new(name, width, height, alpha=False)
    image.colorspace_settings.name = "sRGB"
    image.alpha_mode = "NONE"
    return image


def knows_space(name: str) -> bool:
    """Return whether Blender's color management has a space of this name."""
    return name in bpy.types.Image.bl_rna.properties["colorspace_settings"].fixed_type.properties["name"].enum_items


def fit(image: bpy.types.Image, width: int, height: int) -> None:
    """Resize an image; editors continue to show it."""
    if tuple(image.size) != (width, height):
        image.scale(width, height)


def blank(width: int, height: int) -> np.ndarray:
    """Return an opaque black RGBA buffer [H, W, 4] in Blender's row order; see `upright`."""
    buffer = np.zeros((height, width, 4), np.float32)
    buffer[..., 3] = 1
    return buffer


def upright(buffer: np.ndarray) -> np.ndarray:
    """Return a view of a buffer's colors [H, W, 3], first row at the top."""
    return buffer[::-1, :, :3]


def enlarged(buffer: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize an RGBA buffer [h, w, 4] by linear interpolation between the centers of its pixels."""
    if buffer.shape[:2] == (height, width):
        return buffer
    low, high, share = _between(buffer.shape[0], height)
    tall = buffer[low] + share[:, None, None] * (buffer[high] - buffer[low])
    low, high, share = _between(buffer.shape[1], width)
    return tall[:, low] + share[:, None] * (tall[:, high] - tall[:, low])


def _between(count: int, wanted: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each wanted pixel the two of `count` pixels around its center, and the weight of the second."""
    place = ((np.arange(wanted, dtype=np.float32) + np.float32(0.5)) * count / wanted - 0.5).clip(0, count - 1)
    low = place.astype(np.int64)
    return low, np.minimum(low + 1, count - 1), (place - low).astype(np.float32)


def upload(image: bpy.types.Image, buffer: np.ndarray) -> None:
    """Copy an RGBA buffer [H, W, 4] to an image of the same size."""
    image.pixels.foreach_set(buffer.ravel())
    image.update()


def pixels(image: bpy.types.Image) -> np.ndarray:
    """Return the image's pixels [H, W, 4] float32, first row at the top."""
    width, height = image.size
    buffer = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(buffer)
    return buffer.reshape(height, width, 4)[::-1]


def read_picture(path: Path, long_side: int | None = None) -> np.ndarray:
    """Read a picture's numbers [H, W, 3] float32 as `opened`, transparency put on white; at most `long_side` long."""
    with opened(path) as image:
        if long_side and max(image.size) > long_side:
            image.scale(*(max(1, round(side * long_side / max(image.size))) for side in image.size))
        return colors_of(image)


@contextmanager
def opened(path: Path) -> Iterator[bpy.types.Image]:
    """Load a picture for a `with` block. Raises DataError if it is unreadable, BadRequest while Blender renders."""
    rendering.refuse()
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError as error:
        raise DataError("{path} cannot be read as an image.", "Check the path.", path=path) from error
    try:
        image.colorspace_settings.name = "Non-Color"  # else 16 bit pictures would be made linear
        image.alpha_mode = "CHANNEL_PACKED"  # else colors would be multiplied by the transparency
        if not image.size[0]:
            raise DataError("{path} cannot be read as an image.", "Use PNG or JPEG.", path=path)
        yield image
    finally:
        bpy.data.images.remove(image)


def colors_of(image: bpy.types.Image) -> np.ndarray:
    """Return the image's colors [H, W, 3] float32, transparency put on white."""
    rgba = pixels(image)
    colors, alpha = rgba[..., :3], rgba[..., 3:]
    return colors if alpha.min() == 1 else colors * alpha + (1 - alpha)


def read_mask(path: Path) -> np.ndarray:
    """Read a mask [H, W] bool as `opened`: over one half in alpha if that varies, else in the brightest channel."""
    with opened(path) as image:  # by the same rules as the engine
        rgba = pixels(image)
    color, opaque = rgba[..., :3].max(-1), rgba[..., 3] > 0.5
    brightest = color.max()
    inside = color > (0.5 if brightest > 1.5 / 255 else brightest / 2)  # labels are 0 and 1 of 255
    return opaque if opaque.any() and not opaque.all() else inside & opaque


def read_correction(path: Path) -> np.ndarray:
    """Read a correction [H, W] int8 as `opened`: opaque white (part of the object) is 1, opaque black -1, else 0."""
    with opened(path) as image:
        rgba = pixels(image)
    return np.where(rgba[..., 3] > 0.5, np.where(rgba[..., 0] > 0.5, 1, -1), 0).astype(np.int8)


def resized(colors: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize colors [H, W, 3] in [0, 1], in 8 bits."""
    if colors.shape[1::-1] == (width, height):
        return colors
    with _temporary_image("resized", colors) as image:
        fit(image, width, height)
        return colors_of(image)


def write_png(path: Path, colors: np.ndarray) -> None:
    """Write [H, W, 3] in [0, 1] as an 8 bit PNG, atomically; the numbers are rounded, without view transform."""
    with _temporary_image(path.stem, colors) as image:
        image.file_format = "PNG"
        atomic_write(path, lambda temporary: _save(image, temporary))


@contextmanager
def _temporary_image(name: str, colors: np.ndarray) -> Iterator[bpy.types.Image]:
    height, width = colors.shape[:2]
    buffer = blank(width, height)
    upright(buffer)[:] = colors
    image = new_image(name, width, height)
    try:
        upload(image, buffer)
        yield image
    finally:
        bpy.data.images.remove(image)


def _save(image: bpy.types.Image, path: Path) -> None:
    image.filepath_raw = str(path)
    try:
        image.save()
    except RuntimeError as error:  # a full disk, mostly
        raise DataError(
            "{path} cannot be written.", "Free some space, or choose another folder.", path=path.parent
        ) from error


# --- packing -------------------------------------------------------------------------------------------------------
@dataclass
class ChangedImages:
    last_change: float = 0.0
    names: set[str] = field(default_factory=set)


def note_change(image: bpy.types.Image) -> None:
    """Pack a changed image as soon as it stays the same for a moment: Blender would ask to save it on quitting."""
    if bpy.app.background:
        return
    changed = session.get(ChangedImages)
    changed.last_change = time.monotonic()
    changed.names.add(image.name)
    session.start_timer(_pack_still_images, STILL_SECONDS)


def _pack_still_images() -> float | None:
    changed = session.get(ChangedImages)
    if time.monotonic() - changed.last_change < STILL_SECONDS or not rendering.is_over():
        return STILL_SECONDS
    for name in changed.names & set(bpy.data.images.keys()):
        pack(bpy.data.images[name])
    changed.names.clear()
    return None


def pack(image: bpy.types.Image | None) -> None:
    """Store the pixels of an image in the .blend if they are only in memory, as these would be lost."""
    if image is not None and image.is_dirty:
        image.pack()


@session.handler("save_pre")
def _before_save(*_):
    for scene in bpy.data.scenes:
        pack(scene.karf.result)
