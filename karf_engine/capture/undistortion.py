"""Undistort photos with numpy only, for Blender's camera backgrounds."""

from __future__ import annotations

import numpy as np

from .camera import Camera
from .distortion import distort

ROWS = 16  # rows computed at a time, so that intermediate results fit the CPU cache


def undistorted(photo: np.ndarray, camera: Camera) -> np.ndarray:
    """Undistort a photo as stored, float32 [H, W, C], with bilinear interpolation; black outside the photo.

    The pixels are those of `training_images.undistort`.
    """
    photo = np.ascontiguousarray(photo)
    result = np.empty_like(photo)
    columns = np.arange(camera.width) + 0.5
    for top in range(0, camera.height, ROWS):
        rows = np.arange(top, min(top + ROWS, camera.height)) + 0.5
        positions = distort(camera, np.stack(np.meshgrid(columns, rows), -1))
        is_inside = (positions >= 0) & (positions <= (camera.width, camera.height))  # False for nan
        inside = np.all(is_inside, axis=-1)
        result[top : top + ROWS] = _bilinear(photo, np.where(inside[..., None], positions - 0.5, 0))
        result[top : top + ROWS][~inside] = 0
    return result


def _bilinear(photo: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Sample an image at (column, row) positions [..., 2], clamped to the outer pixel centers; [..., C]."""
    height, width, channels = photo.shape
    pixels = photo.reshape(-1, channels)
    column, row = np.clip(positions[..., 0], 0, width - 1), np.clip(positions[..., 1], 0, height - 1)
    left, top = column.astype(np.intp), row.astype(np.intp)
    fraction_u = (column - left).astype(np.float32)[..., None]
    fraction_v = (row - top).astype(np.float32)[..., None]
    right, below = (left < width - 1).astype(np.intp), (top < height - 1) * width  # index offsets of the neighbors
    corner = top * width + left
    upper = _lerp(pixels.take(corner, 0), pixels.take(corner + right, 0), fraction_u)
    lower = _lerp(pixels.take(corner + below, 0), pixels.take(corner + below + right, 0), fraction_u)
    return _lerp(upper, lower, fraction_v)


def _lerp(first: np.ndarray, second: np.ndarray, weight: np.ndarray) -> np.ndarray:
    return first + (second - first) * weight
