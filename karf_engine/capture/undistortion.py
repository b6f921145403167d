"""Photos as a plain pinhole would have taken them, with numpy alone: what Blender shows behind a camera."""

from __future__ import annotations

import numpy as np

from .camera import Camera
from .distortion import distort

ROWS = 128  # at a time: the lookups of a whole large photo would not fit memory


def undistorted(photo: np.ndarray, camera: Camera) -> np.ndarray:
    """The photo, float32 [H, W, C] as stored, as its camera's pinhole shows it; black where that sees beyond the photo.

    Bilinear, the same pixels as `images.undistort` gives the engine. photo must have the camera's size.
    """
    result = np.zeros_like(photo)
    columns = np.arange(camera.width) + 0.5
    for top in range(0, camera.height, ROWS):
        rows = np.arange(top, min(top + ROWS, camera.height)) + 0.5
        lookup = distort(camera, np.stack(np.meshgrid(columns, rows), -1))
        inside = ((lookup >= 0) & (lookup <= (camera.width, camera.height))).all(-1)  # nan is outside
        result[top : top + ROWS][inside] = _bilinear(photo, lookup[inside] - 0.5)
    return result


def _bilinear(photo: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Values [n, C] of an image at (column, row) positions [n, 2]; beyond the outer pixels' centers theirs."""
    height, width = photo.shape[:2]
    column, row = np.clip(positions, 0, (width - 1, height - 1)).T
    left, top = column.astype(int), row.astype(int)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across = (column - left).astype(np.float32)[:, None]
    down = (row - top).astype(np.float32)[:, None]
    above = photo[top, left] * (1 - across) + photo[top, right] * across
    below = photo[bottom, left] * (1 - across) + photo[bottom, right] * across
    return above * (1 - down) + below * down
