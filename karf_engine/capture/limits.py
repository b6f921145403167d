"""Limits of cameras' numbers: what lies beyond overflows single precision, or no memory holds its pixels."""

from __future__ import annotations

from typing import Any

from ..errors import BadRequest, DataError
from ..io.image_size import MOST_PIXELS
from .camera import POSE_TOLERANCE, Camera, Limits, impossible

LARGEST_POSITION = 1e12  # coordinate: its square, and a scene's size over its detail, fit single precision
LARGEST_SIDE = 10**6  # pixels of a photo's side; a damaged file may claim more
# focal lengths from beyond 179 degrees to a thousandth of one; readers measure poses without the scale that they leave in
# where it is one but for rounding
USABLE = Limits(LARGEST_SIDE, MOST_PIXELS, (1e-3, 1e6), 1e3, 1e6, LARGEST_POSITION, 2 * POSE_TOLERANCE)


def check_camera(camera: Camera, label: str, hint: str = "Export the cameras again.") -> Camera:
    """The camera itself, once its numbers are found usable.

    Args:
        camera: The camera.
        label: Whose it is, for the message, which reads "`label` has ..".
        hint: What the user can do about it.

    Raises:
        DataError: Its size, lens or pose is impossible.
    """
    wrong = impossible(camera, USABLE)
    if wrong:
        raise DataError(f"{label} has {wrong}, which cannot be.", hint)
    return camera


def read_camera(label: str, hint: str = "Export the cameras again.", **numbers: Any) -> Camera:
    """The camera of a file's numbers.

    Args:
        label: Whose it is, for the message, which reads "`label` has ..".
        hint: What the user can do about it.
        **numbers: The attributes of `Camera`.

    Raises:
        DataError: Its size, lens or pose is impossible.
    """
    try:
        camera = Camera(**numbers)
    except BadRequest as error:
        wrong = error.sentence.values.get("wrong", error.sentence)
        raise DataError("{label} has {wrong}, which cannot be.", hint, label=label, wrong=wrong) from error
    return check_camera(camera, label, hint)
