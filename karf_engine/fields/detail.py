"""The image detail that the voxels of a field can represent."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..io.images import resize
from .extent import focus_point
from .rendering.space import Space, space_to_device

STEP = 0.5  # of central differences, pixels


def pixels_per_voxel(space: Space, voxel: float, positions: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the mean size of a voxel in pixels, float64 [n]; nan behind the camera.

    Args:
        space: Space of the voxels.
        voxel: Edge of a voxel, grid units.
        positions: [n, 3], world.
        camera: Without lens distortion.

    Example:
        >>> from .rendering.space import Box
        >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0, np.eye(4))
        >>> pixels_per_voxel(Box(), 0.1, np.array([[0.0, 0.0, -5.0]]), camera).round(3).tolist()
        [2.0]
    """
    space = space_to_device(space, "cpu")
    _, depth = camera.project(positions)
    depth = np.where(depth > 0, depth, np.nan)
    steps = []
    for axis, focal in enumerate((camera.fx, camera.fy)):
        across = STEP * (depth / focal)[:, None] * camera.camera_to_world[:3, axis]
        ahead, behind = (space.to_grid(torch.from_numpy(positions + sign * across).float()) for sign in (1, -1))
        steps.append(torch.linalg.norm(ahead - behind, dim=1).double().numpy() / (2 * STEP))
    return voxel / np.mean(steps, 0)


def typical_pixels_per_voxel(space: Space, voxel: float, views: Sequence[View], points: SparsePoints | None) -> float:
    """Return the median size of a voxel in pixels over all observed points, or at the focus point without any.

    Args:
        space: Space of the voxels.
        voxel: Edge of a voxel, grid units.
        views: With cameras of the image sizes, without lens distortion.
        points: As these views observe them.
    """
    focus = focus_point([view.camera for view in views]).numpy()[None]
    sizes = []
    for number, view in enumerate(views):
        if points is None or not len(points.view):
            positions = focus
        else:
            positions = points.positions[points.point[points.view == number]]
        sizes.append(pixels_per_voxel(space, voxel, positions, view.camera))
    return float(np.nanmedian(np.concatenate(sizes)))


def remove_detail(photo: np.ndarray, pixels: float) -> np.ndarray:
    """Average a float photo [H, W, 3] over voxels of `pixels` >= 1, and interpolate linearly."""
    height, width = photo.shape[:2]
    reduced = resize(photo, max(1, round(width / max(pixels, 1))), max(1, round(height / max(pixels, 1))))
    return resize(reduced, width, height)


def psnr_without_detail(photos: Sequence[np.ndarray], pixels: float) -> list[float]:
    """Return the PSNR in dB of each photo without detail of this many pixels, about what such voxels can reach."""
    return [cv2.PSNR(remove_detail(photo, pixels).astype(float), photo.astype(float), 1.0) for photo in photos]
