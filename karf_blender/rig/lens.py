"""Pinhole cameras and Blender's camera numbers; pure maths, no bpy.

Pinhole: pixels (u right, v down), corners at integers, so a centered principal point is (width / 2, height / 2).
Blender: sensor_fit 'HORIZONTAL', always set explicitly ('AUTO' changes its meaning when the picture is higher than
wide); lens and sensor width in millimeters; shifts in units of the picture's width; fx != fy through the scene's pixel
aspect, with r = fx / fy.
"""

from dataclasses import dataclass

import numpy as np

from ..engine_api import BadRequest, Camera

SENSOR_WIDTH = 36.0


@dataclass(frozen=True)
class Lens:
    """Blender's numbers of one pinhole: lens [mm] for a sensor SENSOR_WIDTH wide, shifts, the scene's pixel aspect."""

    focal_length: float
    shift_x: float
    shift_y: float
    pixel_aspect: tuple[float, float]


def lens_of(camera: Camera) -> Lens:
    """The numbers that make a Blender camera project as this pinhole does (its distortion is left out)."""
    aspect = camera.fx / camera.fy
    return Lens(
        focal_length=camera.fx * SENSOR_WIDTH / camera.width,
        shift_x=(camera.width / 2 - camera.cx) / camera.width,
        shift_y=(camera.cy - camera.height / 2) * aspect / camera.width,
        # Blender takes 1 to 200 only
        pixel_aspect=(1.0, aspect) if aspect >= 1 else (1 / aspect, 1.0),
    )


def pinhole_of(projection: np.ndarray, width: int, height: int, camera_to_world: np.ndarray) -> Camera:
    """The pinhole of a perspective projection, as Blender computes it for any camera settings.

    Args:
        projection: OpenGL projection matrix [4, 4].
        width: Of the picture, in pixels.
        height: Of the picture, in pixels.
        camera_to_world: Pose [4, 4].
    """
    return Camera(
        width=width,
        height=height,
        fx=projection[0, 0] * width / 2,
        fy=projection[1, 1] * height / 2,
        cx=(1 - projection[0, 2]) * width / 2,
        cy=(1 + projection[1, 2]) * height / 2,
        camera_to_world=camera_to_world,
    )


def rigid(matrix: np.ndarray, name: str) -> np.ndarray:
    """A pose without its scale.

    Args:
        matrix: [4, 4].
        name: The camera's, for the error.

    Returns:
        [4, 4] float64: a pure rotation and a position.

    Raises:
        BadRequest: The matrix is sheared or mirrored.
    """
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3) or np.linalg.det(axes) < 0:
        raise BadRequest(
            "The camera {name!r} is mirrored or unevenly scaled, or a parent or the rig is.",
            "Apply the scale, or make it the same on all three axes.",
            name=name,
        )
    pose = np.eye(4)
    pose[:3, :3] = axes
    pose[:3, 3] = matrix[:3, 3]
    return pose
