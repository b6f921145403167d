"""Faces of the cube around a 360-degree photo, whose lens is a `Panorama`: pinhole cameras and their pixels.

A face sees 90 degrees both ways. In the photo's camera axes front looks along -z, right along +x, back along +z and left along
-x, with +y up; up looks along +y and down along -y, each turned from front about x.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from .camera import Camera, Panorama

# face: rotation from its camera axes to the photo's
FACES = {
    "front": np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "right": np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "back": np.array([[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]),
    "left": np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
    "up": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "down": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
}
SAMPLES = 1.25  # along a pixel of the photo in the middle of a face, at least
BLOCK_ROWS = 256  # samples' rows computed at a time, to bound temporaries


def face_camera(panorama: Panorama, face: str, side: int) -> Camera:
    """Return the pinhole camera of a face of `side` x `side` pixels."""
    pose = panorama.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ FACES[face]
    return Camera(side, side, side / 2, side / 2, side / 2, side / 2, pose)


def sample_face(photo: np.ndarray, face: str, side: int) -> np.ndarray:
    """Sample a face of a photo [H, W, C], bilinearly and several times a pixel, to be averaged.

    Returns [n side, n side, C] with a whole n, of the photo's type; float16 becomes float32.
    """
    height, width = photo.shape[:2]
    count = side * max(2, math.ceil(SAMPLES * width / math.pi / side))
    padded = _padded(photo.astype(np.float32) if photo.dtype == np.float16 else photo)
    samples = np.empty((count, count, photo.shape[2]), padded.dtype)
    x = (np.arange(count, dtype=np.float32) + 0.5) * (2 / count) - 1
    for top in range(0, count, BLOCK_ROWS):
        y = -x[top : top + BLOCK_ROWS, None]
        right, up, back = (row[0] * x + row[1] * y - row[2] for row in FACES[face].astype(np.float32))
        longitude, latitude = np.arctan2(right, -back), np.arctan2(up, np.hypot(right, back))
        columns = (longitude / (2 * np.pi) + 0.5) * width + 0.5  # of pixel centers in the padded photo
        rows = (0.5 - latitude / np.pi) * height + 0.5
        shape = samples[top : top + BLOCK_ROWS].shape
        columns, rows = (np.broadcast_to(each, shape[:2]).astype(np.float32) for each in (columns, rows))
        samples[top : top + BLOCK_ROWS] = cv2.remap(padded, columns, rows, cv2.INTER_LINEAR).reshape(shape)
    return samples


def _padded(photo: np.ndarray) -> np.ndarray:
    """Continue a photo by a pixel over the sphere: around it, and over the poles to the opposite longitude."""
    half = photo.shape[1] // 2
    rows = np.concatenate([np.roll(photo[:1], half, 1), photo, np.roll(photo[-1:], half, 1)])
    return np.concatenate([rows[:, -1:], rows, rows[:, :1]], 1)
