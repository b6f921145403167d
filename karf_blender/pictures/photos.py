"""Captured photos as Blender displays them: turned as their cameras expect, without lens distortion, and in sRGB."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..engine_api import (
    Camera,
    DataError,
    ImageHeader,
    MatrixSpace,
    View,
    checked_path,
    find_header,
    linear_to_srgb,
    matrix_space,
    undistorted,
    wrong_size_error,
)
from . import images

MOST_PIXELS = 2_000_000  # pixels of a photo behind a camera; a phone's full photo would block Blender for seconds


ENGINE_KINDS = ("heic", "avif")  # that Blender does not read


def is_shown_as_stored(view: View) -> bool:
    """Return whether Blender, which neither turns photos nor heeds their profiles, shows the file as the view's pinhole."""
    if not view.camera.is_pinhole:
        return False
    header = _header(view)
    is_read = header is None or header.kind not in ENGINE_KINDS
    return is_read and _orientation(view, header) == 1 and _space(header) is None


def copy_for(view: View, folder: Path) -> Path | None:
    """Return the place in the folder of the engine's copy of a photo that Blender cannot read; None if it can."""
    header = _header(view)
    return _copy(view, folder, "copy") if header is not None and header.kind in ENGINE_KINDS else None


def readable(view: View, folder: Path) -> View | None:
    """Return the view with a photo that Blender reads: its own or the engine's copy; None without a copy."""
    copy = copy_for(view, folder)
    if copy is None:
        return view
    return replace(view, image=copy) if copy.exists() else None


def read(view: View, long_side: int | None = None) -> np.ndarray:
    """Read the distorted photo: [H, W, 3] float32, sRGB in [0, 1], at most `long_side` long; may raise DataError."""
    return _taken(view, images.read_picture(view.image, long_side))


def taken(view: View, folder: Path) -> Path:
    """Return a file that Blender shows like `read`: the photo if possible, else a copy in the folder, made once.

    The photo's profile is not heeded: a mask needs no exact color, and a copy of all pixels takes seconds.
    """
    header = _header(view)
    if _orientation(view, header) == 1 and (header is None or header.kind != "exr"):
        return view.image
    path = _copy(view, folder, "taken")
    if not path.exists():
        images.write_png(path, read(view))
    return path


def straightened(view: View, folder: Path) -> Path:
    """Return a PNG of the photo as the view's pinhole shows it, at most MOST_PIXELS large, made once in the folder.

    Raises DataError if the photo cannot be read or has another size than its camera.
    """
    shrink = min(1.0, (MOST_PIXELS / (view.camera.width * view.camera.height)) ** 0.5)
    camera = view.camera.scaled(*(max(1, round(side * shrink)) for side in (view.camera.width, view.camera.height)))
    lens = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion, camera.fisheye)
    path = _copy(view, folder, lens)
    if not path.exists():
        images.write_png(path, undistorted(_read_small(view, camera), camera))
    return path


def _copy(view: View, folder: Path, purpose: object) -> Path:
    made_from = repr((view.image.name, view.image.stat().st_mtime_ns, purpose))  # stays where the folder moves
    return checked_path(folder, f"{view.name}-{hashlib.sha256(made_from.encode()).hexdigest()[:8]}.png")


def _read_small(view: View, camera: Camera) -> np.ndarray:
    is_turned = _orientation(view, _header(view)) >= 5
    with images.opened(view.image) as image:
        width, height = reversed(image.size) if is_turned else image.size
        if (width, height) != (view.camera.width, view.camera.height):
            raise wrong_size_error(view.image, width, height, view.camera)
        size = (camera.height, camera.width) if is_turned else (camera.width, camera.height)
        images.fit(image, *size)
        return _taken(view, images.colors_of(image))


def _taken(view: View, picture: np.ndarray) -> np.ndarray:
    header = _header(view)
    if header is not None and header.kind == "exr":  # linear light, which may be brighter than white
        picture = linear_to_srgb(np.clip(picture, 0, 1))
    elif space := _space(header):
        picture = space.to_srgb(picture)
    return _turned(picture, _orientation(view, header))


def _space(header: ImageHeader | None) -> MatrixSpace | None:
    """Return the color space of a photo's profile; None if it is sRGB, or of a kind that needs the engine."""
    return matrix_space(header.profile) if header is not None else None


def _orientation(view: View, header: ImageHeader | None) -> int:
    """Return the Exif orientation (1..8) to apply: 1 if the camera describes the pixels as stored."""
    is_upright = header is not None and header.display_size == (view.camera.width, view.camera.height)
    return header.orientation if is_upright else 1


def _header(view: View) -> ImageHeader | None:
    """Return the photo's header, or None. Raises DataError if the file cannot be opened."""
    try:
        return find_header(view.image)
    except OSError as error:
        raise DataError(
            "{path} cannot be read: {reason}.", "Check the file.", path=view.image, reason=error.strerror
        ) from error


def _turned(picture: np.ndarray, orientation: int) -> np.ndarray:
    """Turn and mirror a stored picture [H, W, C] by its Exif orientation (1..8)."""
    if orientation >= 5:
        picture = picture.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        picture = picture[::-1]
    if orientation in (2, 3, 6, 7):
        picture = picture[:, ::-1]
    return picture
