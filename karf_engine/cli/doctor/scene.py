"""The smoke run's capture: two diffuse balls under one lamp, ray-cast in closed form, and a mask of one of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...capture import Camera, View, write_cameras
from ...io.images import write_png

OBJECT = "ball"  # the marked object
SIZE = 32  # pixels along each side of a photo
PHOTOS = 12
FOCAL_LENGTH = 1.35 * SIZE
DISTANCE = 3.6  # of the cameras from the origin; all balls are within distance 1 of it
LAMP = np.array([0.4, -0.5, 0.77])
RADIUS = 0.45
BALLS = (((-0.5, 0.0, 0.1), (0.85, 0.15, 0.1)), ((0.5, 0.1, -0.1), (0.15, 0.3, 0.8)))  # center and color; marked first
TEST = 1  # the held-out photo


def write_scene(capture: Path, masks: Path) -> None:
    """Write the photos with their cameras, and the mask of the marked ball in the first one."""
    views = []
    for number in range(PHOTOS):
        camera = _camera(2 * np.pi * number / PHOTOS, (0.35, 0.75, 1.1)[number % 3])
        photo, is_marked = _photograph(camera)
        name = f"photo_{number}"
        views.append(View(name, name, camera, None, "test" if number == TEST else "train"))
        write_png(capture / f"{name}.png", photo)
        if number == 0:
            write_png(masks / OBJECT / f"{name}.png", is_marked)
    write_cameras(capture / "transforms.json", views)


def _camera(azimuth: float, elevation: float) -> Camera:
    """Return a camera at these angles in radians that faces the origin, z up."""
    back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], 1)
    pose[:3, 3] = DISTANCE * back
    return Camera(SIZE, SIZE, FOCAL_LENGTH, FOCAL_LENGTH, SIZE / 2, SIZE / 2, pose)


def _photograph(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return a photo with alpha [H, W, 4], and the mask of the marked ball [H, W]."""
    origins, directions = camera.rays(camera.pixel_centers())
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    nearest, photo, shown = np.full(len(origins), np.inf), np.zeros((len(origins), 4)), np.full(len(origins), -1)
    for index, (center, color) in enumerate(BALLS):
        offset = origins - center
        half_b = (offset * directions).sum(1)
        discriminant = half_b**2 - (offset**2).sum(1) + RADIUS**2
        distance = -half_b - np.sqrt(np.maximum(discriminant, 0))
        is_hit = (discriminant > 0) & (distance < nearest)
        normals = (offset + distance[:, None] * directions)[is_hit] / RADIUS
        shade = 0.55 + 0.45 * np.clip(normals @ LAMP, 0, 1)
        photo[is_hit] = np.c_[shade[:, None] * color, np.ones(len(shade))]
        nearest[is_hit], shown[is_hit] = distance[is_hit], index
    return photo.reshape(SIZE, SIZE, 4), (shown == 0).reshape(SIZE, SIZE)
