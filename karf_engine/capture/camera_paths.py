"""Camera paths for turntables and fly-throughs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import BadRequest
from ..io.arguments import check_arguments, check_number
from .camera import Camera
from .placement import horizontal_axes, measure_placement

INTRINSICS = ("fx", "fy", "cx", "cy")
NO_POINTS = np.zeros((0, 3))


@check_arguments
def orbit(cameras: Sequence[Camera], count: int, elevation: float | None = None) -> list[Camera]:
    """Return pinhole cameras on a circle around what a capture's cameras look at, all looking at its center.

    Axis, center and radius are those of the capture; size and focal length are the first camera's.

    Args:
        cameras: The capture's cameras, at least one.
        count: Number of cameras, evenly spaced; the last is one step before the first.
        elevation: Height above the horizon seen from the center, degrees; None for the median of the capture's.

    Raises:
        BadRequest: There are no cameras, the count is below 1, or the elevation is beyond -89 to 89 degrees.

    Example:
        orbit([view.camera for view in model.capture.views], 120)
    """
    _require(cameras, 1)
    check_number("count", count, 1)
    placement = measure_placement(cameras, NO_POINTS)
    azimuth, elevations = np.radians(placement.angles(placement.directions).T)
    height = float(np.degrees(np.median(elevations))) if elevation is None else elevation
    check_number("elevation", height, -89, 89)
    right, forward = horizontal_axes(placement.up)
    first = cameras[0].without_distortion()
    first = replace(first, cx=first.width / 2, cy=first.height / 2)
    found = []
    for angle in azimuth[0] + np.arange(count) * 2 * np.pi / count:
        level = np.cos(angle) * right + np.sin(angle) * forward
        direction = np.cos(np.radians(height)) * level + np.sin(np.radians(height)) * placement.up
        pose = looking_at(placement.center + placement.radius * direction, placement.center, placement.up)
        found.append(replace(first, camera_to_world=pose))
    return found


@check_arguments
def camera_spline(cameras: Sequence[Camera], count: int, is_closed: bool = False) -> list[Camera]:
    """Return pinhole cameras along a smooth path through these cameras, in order, at equal steps between them.

    Positions and intrinsics follow cubic splines, rotations a rotation spline. All have the first camera's size.

    Args:
        cameras: At least two.
        count: Number of cameras, at least two; the first and, on an open path, the last are those given.
        is_closed: Whether the path returns to the first camera.

    Raises:
        BadRequest: There are fewer than two cameras, or the count is below two.

    Example:
        camera_spline([view.camera for view in model.capture.views[:3]], 60)
    """
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    _require(cameras, 2)
    check_number("count", count, 2)
    first = cameras[0].without_distortion()
    keys = [camera.without_distortion().scaled(first.width, first.height) for camera in cameras]
    keys += [first] * is_closed
    times = np.linspace(0, len(keys) - 1, count, endpoint=not is_closed)
    values = [[*camera.position, *(getattr(camera, name) for name in INTRINSICS)] for camera in keys]
    path = CubicSpline(np.arange(len(keys)), values, bc_type="periodic" if is_closed else "natural")(times)
    rotations = Rotation.from_matrix([camera.camera_to_world[:3, :3] for camera in keys])
    found = []
    turned = RotationSpline(np.arange(len(keys)), rotations)(times).as_matrix()
    for (x, y, z, *intrinsics), rotation in zip(path, turned, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, (x, y, z)
        found.append(replace(first, camera_to_world=pose, **dict(zip(INTRINSICS, map(float, intrinsics), strict=True))))
    return found


def _require(cameras: Sequence[Camera], count: int) -> None:
    if len(cameras) < count:
        raise BadRequest(f"A path needs {count} cameras or more, and has {len(cameras)}.", "Give more cameras.")


def looking_at(position: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the pose [4, 4] of a camera that looks at a target."""
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, position], 1)
    return pose
