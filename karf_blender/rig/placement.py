"""Where a capture's world stands in Blender's: upright and at a size, or as in its file. Pure maths, no bpy.

Only the rig's Empty takes this matrix; what is learned stays in the capture's own world.
"""

import numpy as np

from ..engine_api import Capture

ORIENTATIONS = ("auto", "file", "upright")
ARBITRARY_WORLDS = ("llff", "colmap")  # formats without a known up axis
UP_WEIGHT = 0.01  # weight of the cameras' up axes, which decide where their right axes leave it open


def matrix_of(capture: Capture, orientation: str, size: float) -> np.ndarray:
    """World matrix of the Empty: a rotation times a uniform scale.

    Args:
        capture: The capture.
        orientation: `file`, `upright` (the cameras' up becomes +z), or `auto`: upright where the format's world is
            arbitrary.
        size: Extent of the cameras in Blender units; 0: as in the file.

    Returns:
        [4, 4] float64.
    """
    matrix = np.eye(4)
    if orientation == "upright" or (orientation == "auto" and _is_arbitrary(capture)):
        matrix[:3, :3] = turn_to_z(up_of(capture))
    if size:
        matrix[:3, :3] *= size / extent(capture)
    return matrix


def _is_arbitrary(capture: Capture) -> bool:
    """Whether nothing says what is up in its world."""
    return capture.format in ARBITRARY_WORLDS or capture.splats is not None


def extent(capture: Capture) -> float:
    """Diagonal of the box round all cameras, in world units; 1 where they are all in one place."""
    positions = np.array([view.camera.position for view in capture.views])
    return float(np.linalg.norm(np.ptp(positions, axis=0))) or 1.0


def up_of(capture: Capture) -> np.ndarray:
    """The direction, [3] of length 1, that people who took the photos would call up.

    It is perpendicular to the cameras' right axes, for photos are tilted more than they are rolled; where these axes
    are all alike and leave it open, it is the mean of the cameras' up axes.
    """
    axes = np.array([view.camera.camera_to_world[:3, :3] for view in capture.views])
    right, up = axes[..., 0], axes[..., 1].mean(axis=0)
    found = np.linalg.solve(right.T @ right / len(right) + UP_WEIGHT * np.eye(3), up)
    length = np.linalg.norm(found)
    return found / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def turn_to_z(direction: np.ndarray) -> np.ndarray:
    """The smallest rotation [3, 3] that takes a direction [3] of length 1 to +z."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0, 0, -x], [0, 0, -y], [x, y, 0]])  # of direction x +z, as a matrix
    return np.eye(3) + cross + cross @ cross / (1 + z)
