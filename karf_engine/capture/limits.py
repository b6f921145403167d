"""Limits of cameras' numbers: what lies beyond overflows single precision, or no memory holds its pixels."""

from __future__ import annotations

import numpy as np

from ..errors import DataError
from ..io.image_size import MOST_PIXELS
from .camera import Camera

LARGEST_POSITION = 1e12  # coordinate: its square, and a scene's size over its detail, fit single precision
LARGEST_SIDE = 10**6  # pixels of a photo's side; a damaged file may claim more
FOCAL_RANGE = (1e-3, 1e6)  # focal length in longer sides: from beyond 179 degrees to a thousandth of one
LARGEST_CENTER = 1e3  # coordinate of the principal point, in longer sides
LARGEST_COEFFICIENT = 1e6  # coefficient of a lens polynomial


def check_camera(camera: Camera, label: str, hint: str = "Export the cameras again.") -> Camera:
    """The camera itself, once its numbers are found possible.

    Args:
        camera: The camera.
        label: Whose it is, for the message, which reads "`label` has ..".
        hint: What the user can do about it.

    Raises:
        DataError: Its size, lens or position is impossible.
    """
    wrong = _wrong(camera)
    if wrong:
        raise DataError(f"{label} has {wrong}, which cannot be.", hint)
    return camera


def _wrong(camera: Camera) -> str:
    """Which number is impossible, with its value; empty where all are possible. Not-a-number fails every comparison."""
    width, height, side = camera.width, camera.height, max(camera.width, camera.height)
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        return f"a picture of {width}x{height} pixels"
    if width * height > MOST_PIXELS:
        return f"a picture of {width}x{height} pixels, more than {MOST_PIXELS // 10**6} million"
    for name in ("fx", "fy"):
        if not FOCAL_RANGE[0] * side <= getattr(camera, name) <= FOCAL_RANGE[1] * side:
            return f"the focal length {name} {getattr(camera, name):g} at {width}x{height} pixels"
    for name in ("cx", "cy"):
        if not abs(getattr(camera, name)) <= LARGEST_CENTER * side:
            return f"the principal point {name} {getattr(camera, name):g} at {width}x{height} pixels"
    for value in camera.distortion:
        if not abs(value) <= LARGEST_COEFFICIENT:
            return f"the distortion coefficient {value:g}"
    if not np.abs(camera.position).max() <= LARGEST_POSITION:
        return f"the position {', '.join(f'{value:g}' for value in camera.position)}"
    return ""
