"""Photos without their lens distortion, with numpy alone: what Blender shows behind a camera."""

from __future__ import annotations

import numpy as np

from .camera import Camera
from .distortion import distort

ROWS = 16  # rows computed at a time: intermediate results stay in the processor's cache


def undistorted(photo: np.ndarray, camera: Camera) -> np.ndarray:
    """A photo as its camera's pinhole shows it, interpolated linearly: the pixels of `training_images.undistort`.

    Args:
        photo: As stored, float32 [H, W, C], of the camera's size.
        camera: With its distortion.

    Returns:
        float32 [H, W, C]; black where the pinhole sees beyond the photo.
    """
    photo = np.ascontiguousarray(photo)
    result = np.empty_like(photo)
    columns = np.arange(camera.width) + 0.5
    for top in range(0, camera.height, ROWS):
        rows = np.arange(top, min(top + ROWS, camera.height)) + 0.5
        positions = distort(camera, np.stack(np.meshgrid(columns, rows), -1))
        inside = ((positions >= 0) & (positions <= (camera.width, camera.height))).all(-1)  # nan is outside
        result[top : top + ROWS] = _bilinear(photo, np.where(inside[..., None], positions - 0.5, 0))
        result[top : top + ROWS][~inside] = 0
    return result


def _bilinear(photo: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Values [.., C] of an image at (column, row) positions [.., 2]; beyond the outer pixels' centers theirs."""
    height, width, channels = photo.shape
    pixels = photo.reshape(-1, channels)
    column, row = np.clip(positions[..., 0], 0, width - 1), np.clip(positions[..., 1], 0, height - 1)
    left, top = column.astype(np.intp), row.astype(np.intp)
    across, down = ((exact - whole).astype(np.float32)[..., None] for exact, whole in ((column, left), (row, top)))
    right, below = (left < width - 1).astype(np.intp), (top < height - 1) * width  # steps to the neighbors
    corner = top * width + left
    upper = _between(pixels.take(corner, 0), pixels.take(corner + right, 0), across)
    lower = _between(pixels.take(corner + below, 0), pixels.take(corner + below + right, 0), across)
    return _between(upper, lower, down)


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    return first + (second - first) * share
