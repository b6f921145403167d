"""Image files in and out, resizing and undistortion (rounding to 8 bit is `edit.color.to_bytes`).

Images are float32 [H, W, C], display-referred sRGB in [0, 1], row 0 at the top. Pixel corners lie at integers, so the
value at [row, column] belongs to the position (u, v) = (column + 0.5, row + 0.5). Alpha is straight, not multiplied in.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter

from .capture.camera import Camera
from .capture.capture import View
from .capture.distortion import distort
from .capture.image_size import unreadable
from .edit.color import to_bytes
from .errors import DataError
from .project import atomic_write

BORDER_TOLERANCE = 0.04  # a border pixel this near to black or white counts as such: JPEG noise, dark gray paper
BORDER_SHARE = 0.8  # of the border's pixels: an object may touch the border
SOLID_DIFFERENCE = 0.06  # a pixel this far from a black or white background shows something
VIEW_SHARE = 0.9  # of the views: a few may be close-ups


@dataclass(frozen=True)
class Plate:
    """A captured view at the working size, without lens distortion.

    camera: pinhole at the working size. color: float32 [H, W, 3], straight. alpha: float32 [H, W], or None where the
    photo is opaque. valid: bool [H, W], False where undistortion looked outside the photo, or None where all is valid.
    """

    view: View
    camera: Camera
    color: np.ndarray
    alpha: np.ndarray | None
    valid: np.ndarray | None


# ---------------------------------------------------------------------------------------------------------------- files
def read_photo(path: Path, upright: bool = True) -> np.ndarray:
    """Read a picture as float32 [H, W, 3 or 4] in [0, 1], turned as its Exif orientation says if `upright`.

    Gray and palette pictures become RGB. 16-bit gray is exact; 16-bit color is read at 8 bit, as Pillow decodes it.
    Raises DataError naming the file and the reason where it cannot be read.
    """
    try:
        with iio.imopen(path.read_bytes(), "r", plugin="pillow") as file:
            mode = _mode_to_read(file.metadata(index=0))
            return _as_colors(file.read(index=0, mode=mode, rotate=upright))
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise DataError(f"{path} cannot be read: {error.strerror}.", "Check the path.") from error
    except Exception as error:  # damaged files make decoders raise nearly anything
        raise unreadable(path, str(error) or type(error).__name__) from error


def _mode_to_read(stored: dict[str, Any]) -> str | None:
    """Pillow's mode to convert a picture to, of its metadata; None keeps gray ones as deep as they are."""
    if stored["mode"] in ("LA", "PA", "RGBA") or "transparency" in stored:
        return "RGBA"
    is_gray = stored["mode"] in ("1", "L", "F") or stored["mode"].startswith("I")
    return None if is_gray else "RGB"


def _as_colors(pixels: np.ndarray) -> np.ndarray:
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=-1)
    largest = 255 if pixels.dtype == np.uint8 else 65535 if pixels.dtype.kind in "ui" else 1
    return np.clip(pixels.astype(np.float32) / largest, 0, 1)


def write_png(path: Path, array: np.ndarray) -> None:
    """Write [H, W] or [H, W, 1, 3 or 4] as PNG, atomically: float in [0, 1] is clipped and rounded to 8 bit, bool
    becomes 0 and 255, uint8 is kept, uint16 [H, W] (depth) becomes 16-bit gray. Raises TypeError for other kinds."""
    if np.issubdtype(array.dtype, np.floating):
        array = to_bytes(array)
    elif array.dtype == bool:
        array = array.astype(np.uint8) * 255
    if array.dtype not in (np.uint8, np.uint16) or (array.dtype == np.uint16 and array.squeeze().ndim != 2):
        raise TypeError(f"a PNG cannot hold an array of {array.dtype} {array.shape}")
    if array.ndim == 3 and array.shape[-1] == 1:
        array = array[..., 0]
    atomic_write(path, lambda file: iio.imwrite(file, array, plugin="pillow", extension=".png", is_batch=False))


def read_mask(path: Path) -> np.ndarray:
    """Read a mask as bool [H, W]: alpha where it tells inside from outside, else the brightest channel, over one half.

    A file whose only values are 0 and 1 (of 255) is read as a label image. Raises DataError naming the file.
    """
    photo = read_photo(path)
    color = photo[..., :3].max(-1)
    brightest = color.max()
    inside = color > (0.5 if brightest > 1.5 / 255 else brightest / 2)
    if photo.shape[-1] == 3:
        return inside
    opaque = photo[..., 3] > 0.5
    # a cut-out may have any color; a mask saved with a flat alpha channel has its shape in the color
    return opaque if opaque.any() and not opaque.all() else inside & opaque


# ------------------------------------------------------------------------------------------------------------- geometry
def resize(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize float [H, W] or [H, W, C] to [height, width, ...]: exact area averaging along an axis that shrinks,
    linear interpolation along an axis that grows."""
    for axis, size in ((0, height), (1, width)):
        if size < image.shape[axis]:
            image = _area_average(image, size, axis)
        elif size > image.shape[axis]:
            image = _interpolate(image, size, axis)
    return image


def _area_average(image: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Difference of the running integral, taken at the borders of the new pixels."""
    length = image.shape[axis]
    rows = np.moveaxis(image, axis, 0)
    integral = np.concatenate([np.zeros_like(rows[:1], np.float64), np.cumsum(rows, axis=0, dtype=np.float64)])
    borders = _sample_rows(integral, np.linspace(0, length, size + 1))
    return np.moveaxis(np.diff(borders, axis=0) * (size / length), 0, axis).astype(np.float32)


def _interpolate(image: np.ndarray, size: int, axis: int) -> np.ndarray:
    length = image.shape[axis]
    centers = (np.arange(size) + 0.5) * (length / size) - 0.5
    rows = _sample_rows(np.moveaxis(image, axis, 0), np.clip(centers, 0, length - 1))
    return np.moveaxis(rows, 0, axis).astype(np.float32)


def _sample_rows(rows: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Linear interpolation along the first axis at row indices `positions` within [0, len(rows) - 1]."""
    below = np.minimum(positions.astype(int), len(rows) - 1)
    above = np.minimum(below + 1, len(rows) - 1)
    share = (positions - below).reshape(-1, *[1] * (rows.ndim - 1))
    return rows[below] * (1 - share) + rows[above] * share


def undistort(image: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera, np.ndarray]:
    """Remove the lens distortion of `camera` from float [H, W, C]; focal lengths, center and size stay.

    Returns the image, its pinhole camera, and valid bool [H, W]: where the photo was looked up inside its borders.
    """
    if camera.is_pinhole:
        return image, camera.without_distortion(), np.ones(image.shape[:2], bool)
    lookup = distort(camera, camera.pixel_centers()).reshape(camera.height, camera.width, 2)
    inside = (lookup >= 0) & (lookup <= (camera.width, camera.height))  # nan is outside
    u, v = np.nan_to_num(lookup[..., 0], nan=-1e6) - 0.5, np.nan_to_num(lookup[..., 1], nan=-1e6) - 0.5
    channels = [map_coordinates(image[..., i], [v, u], order=1, mode="nearest") for i in range(image.shape[-1])]
    return np.stack(channels, -1), camera.without_distortion(), inside.all(-1)


# ------------------------------------------------------------------------------------------------------------- captures
def load_views(views: Sequence[View], long_side: int) -> list[Plate]:
    """Read the photos of the views, undistort them and shrink them so that no side exceeds `long_side` pixels.

    Photos are never enlarged. Raises DataError naming the photo that is missing, damaged or of another size.
    """
    return [_load_view(view, long_side) for view in views]


def _load_view(view: View, long_side: int) -> Plate:
    photo = _photo_of(view)
    camera = view.camera
    factor = min(1.0, long_side / max(camera.width, camera.height))
    width, height = max(1, round(camera.width * factor)), max(1, round(camera.height * factor))
    opaque = photo.shape[-1] == 3 or bool((photo[..., 3] == 1).all())
    if opaque:
        photo = photo[..., :3]
    if camera.is_pinhole and (width, height) == (camera.width, camera.height):
        return Plate(view, camera, photo[..., :3], None if opaque else photo[..., 3], None)

    # averages must not mix in the hidden colors of transparent pixels
    photo, pinhole, valid = undistort(photo if opaque else _premultiplied(photo), camera)
    photo = resize(photo, width, height)
    valid = resize(valid.astype(np.float32), width, height) > 0.999
    return Plate(
        view,
        pinhole.scaled(width, height),
        photo if opaque else _straight(photo),
        None if opaque else photo[..., 3],
        None if valid.all() else valid,
    )


def _photo_of(view: View) -> np.ndarray:
    """The view's photo in the orientation that its camera was made for."""
    if view.image is None:
        raise DataError(f"View {view.name!r} is a bare camera without a photo.", "Give a capture with photos.")
    size = (view.camera.height, view.camera.width)
    for upright in (True, False):
        photo = read_photo(view.image, upright)
        if photo.shape[:2] == size:
            return photo
    raise DataError(
        f"{view.image} is {photo.shape[1]}x{photo.shape[0]} pixels where its camera has {size[1]}x{size[0]}.",
        "Import the capture again.",
    )


def _premultiplied(photo: np.ndarray) -> np.ndarray:
    return np.concatenate([photo[..., :3] * photo[..., 3:], photo[..., 3:]], -1)


def _straight(photo: np.ndarray) -> np.ndarray:
    alpha = photo[..., 3:]
    color = np.divide(photo[..., :3], alpha, out=np.zeros_like(photo[..., :3]), where=alpha > 0)
    return np.minimum(color, 1.0)  # the quotient may round to above one


def background_kind(photos: Iterable[np.ndarray]) -> str:
    """What surrounds the object in float photos [H, W, 3 or 4]: `alpha` (a matte), `black`, `white`, or `opaque`
    (a real background). An alpha channel that is 1 everywhere is no matte."""
    kinds = [_background_of(photo) for photo in photos]
    for kind in ("alpha", "black", "white"):
        if kinds and kinds.count(kind) >= VIEW_SHARE * len(kinds):
            return kind
    return "opaque"


def _background_of(photo: np.ndarray) -> str:
    if photo.shape[-1] == 4 and (photo[..., 3] < 1).any():
        return "alpha"
    border = np.concatenate([photo[0], photo[-1], photo[1:-1, 0], photo[1:-1, -1]])[:, :3]
    if (border.max(-1) <= BORDER_TOLERANCE).mean() >= BORDER_SHARE:
        return "black"
    if (border.min(-1) >= 1 - BORDER_TOLERANCE).mean() >= BORDER_SHARE:
        return "white"
    return "opaque"


def solid_pixels(color: np.ndarray, kind: str) -> np.ndarray:
    """Pixels [H, W] that surely show something opaque before a `black` or `white` background; color [H, W, 3].

    They differ from the background, and by more than half of what their neighbors do: a mixed pixel at an edge does not.
    """
    difference = color.max(-1) if kind == "black" else 1 - color.min(-1)
    return (difference > SOLID_DIFFERENCE) & (difference > 0.8 * maximum_filter(difference, 3))
