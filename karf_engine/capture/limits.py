"""Limits of camera parameters: larger values overflow single precision or memory."""

from __future__ import annotations

from typing import Any

from ..errors import BadRequest, DataError
from ..io.image_size import MOST_PIXELS
from .camera import POSE_TOLERANCE, Camera, Limits, find_invalid_parameter

LARGEST_POSITION = 1e12  # its square fits single precision
LARGEST_SIDE = 10**6  # pixels
# focal lengths of fields of view from above 179 degrees to 0.001; twice the tolerance, since `reading.rigid_pose` accepts
# scales that are 1 up to rounding
USABLE = Limits(LARGEST_SIDE, MOST_PIXELS, (1e-3, 1e6), 1e3, 1e6, LARGEST_POSITION, 2 * POSE_TOLERANCE)


def check_camera(camera: Camera, label: str, hint: str = "Export the cameras again.") -> Camera:
    """Return a camera if its parameters are within the limits.

    Raises DataError "`label` has ..." with the remedy `hint` if they are not.
    """
    wrong = find_invalid_parameter(camera, USABLE)
    if wrong:
        raise DataError(f"{label} has {wrong}, which cannot be.", hint)
    return camera


def read_camera(label: str, hint: str = "Export the cameras again.", **numbers: Any) -> Camera:
    """Make a camera from the attributes of `Camera`. Raises DataError as `check_camera`."""
    try:
        camera = Camera(**numbers)
    except BadRequest as error:
        wrong = error.sentence.values.get("wrong", error.sentence)
        raise DataError("{label} has {wrong}, which cannot be.", hint, label=label, wrong=wrong) from error
    return check_camera(camera, label, hint)
