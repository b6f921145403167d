"""Captured photos as Blender shows them: turned as their camera was made for, and without lens distortion."""

import hashlib
from pathlib import Path

import numpy as np

from ..engine_api import (
    Camera,
    DataError,
    View,
    checked_path,
    find_header,
    linear_to_srgb,
    undistorted,
    wrong_size_error,
)
from . import images

SHOWN_PIXELS = 2_000_000  # pixels of a photo behind a camera; a phone's full photo would block Blender for seconds


def is_shown_as_stored(view: View) -> bool:
    """Whether the photo's own pixels, which Blender does not turn, are what the view's pinhole shows."""
    return view.camera.is_pinhole and _orientation(view) == 1


def read(view: View, long_side: int | None = None) -> np.ndarray:
    """The photo as its camera, lens and all, has taken it: the picture that masks are painted on.

    Returns:
        [H, W, 3] float32, sRGB in [0, 1]; at most `long_side` pixels long.

    Raises:
        DataError: The photo cannot be read.
    """
    return _taken(view, images.read_picture(view.image, long_side))


def taken(view: View, folder: Path) -> Path:
    """A file that Blender shows as `read` gives the photo: its own where it can, else a copy in the folder, made once.

    Raises:
        DataError: The photo cannot be read.
    """
    header = _header(view)
    if _orientation(view) == 1 and (header is None or header.kind != "exr"):
        return view.image
    path = _copy(view, folder, "taken")
    if not path.exists():
        images.write_png(path, read(view))
    return path


def straightened(view: View, folder: Path) -> Path:
    """The photo as the view's pinhole shows it, as a PNG in the folder of at most SHOWN_PIXELS, made once.

    Raises:
        DataError: The photo cannot be read, or has another size than its camera.
    """
    camera = _shown(view.camera)
    lens = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion, camera.fisheye)
    path = _copy(view, folder, lens)
    if not path.exists():
        images.write_png(path, undistorted(_read_small(view, camera), camera))
    return path


def _copy(view: View, folder: Path, purpose: object) -> Path:
    """The name of a copy of the photo as it is now, for a purpose."""
    made_from = repr((str(view.image), view.image.stat().st_mtime_ns, purpose))
    return checked_path(folder, f"{view.name}-{hashlib.sha256(made_from.encode()).hexdigest()[:8]}.png")


def _shown(camera: Camera) -> Camera:
    """The camera at the size of the picture behind it, which Blender stretches over its frame."""
    shrink = min(1.0, (SHOWN_PIXELS / (camera.width * camera.height)) ** 0.5)
    return camera.scaled(max(1, round(camera.width * shrink)), max(1, round(camera.height * shrink)))


def _read_small(view: View, camera: Camera) -> np.ndarray:
    """The photo as `read` gives it, at the size of the camera given."""
    is_turned = _orientation(view) >= 5
    with images.opened(view.image) as image:
        width, height = reversed(image.size) if is_turned else image.size
        if (width, height) != (view.camera.width, view.camera.height):
            raise wrong_size_error(view.image, width, height, view.camera)
        size = (camera.height, camera.width) if is_turned else (camera.width, camera.height)
        images.fit(image, *size)
        return _taken(view, images.colors_of(image))


def _taken(view: View, picture: np.ndarray) -> np.ndarray:
    """A photo's own numbers [H, W, 3] as stored, as the camera has taken it, sRGB."""
    header = _header(view)
    if header is not None and header.kind == "exr":  # linear light, which may be brighter than white
        picture = linear_to_srgb(np.clip(picture, 0, 1))
    return _turned(picture, _orientation(view))


def _orientation(view: View) -> int:
    """The Exif orientation (1..8) to apply: the photo's own, or 1 where its camera is that of the pixels as stored."""
    header = _header(view)
    is_upright = header is not None and header.display_size == (view.camera.width, view.camera.height)
    return header.orientation if is_upright else 1


def _header(view: View):
    """What the photo's head says, or None. Raises DataError where the file cannot be opened."""
    try:
        return find_header(view.image)
    except OSError as error:
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the file.", path=view.image, reason=error.strerror
        ) from error


def _turned(picture: np.ndarray, orientation: int) -> np.ndarray:
    """A picture [H, W, C] as stored, turned and mirrored as its Exif orientation (1..8) says."""
    if orientation >= 5:
        picture = picture.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        picture = picture[::-1]
    if orientation in (2, 3, 6, 7):
        picture = picture[:, ::-1]
    return picture
