"""How much of the photos' detail a field's voxels can hold, where the photos look."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..io.images import resize
from .extent import focus_point
from .rendering.space import Space
from .rendering.space_values import space_on

STEP = 0.5  # pixels to either side over which a space counts as straight


def pixels_per_voxel(space: Space, voxel: float, positions: np.ndarray, camera: Camera) -> np.ndarray:
    """Pixels of a picture that a voxel spans at some places, the mean along its two sides.

    Args:
        space: What the voxels are cubes in.
        voxel: Their edge, grid coordinates.
        positions: [n, 3], world; in front of the camera.
        camera: Without a lens distortion.

    Returns:
        float64 [n]; nan for places that are not in front of the camera.

    Example:
        >>> from .rendering.space import Box
        >>> camera = Camera(100, 100, 100.0, 100.0, 50.0, 50.0, np.eye(4))
        >>> pixels_per_voxel(Box(), 0.1, np.array([[0.0, 0.0, -5.0]]), camera).round(3).tolist()
        [2.0]
    """
    space = space_on(space, "cpu")
    _, depth = camera.project(positions)
    depth = np.where(depth > 0, depth, np.nan)
    steps = []
    for axis, focal in enumerate((camera.fx, camera.fy)):
        across = STEP * (depth / focal)[:, None] * camera.camera_to_world[:3, axis]
        ahead, behind = (space.to_grid(torch.from_numpy(positions + sign * across).float()) for sign in (1, -1))
        steps.append(torch.linalg.norm(ahead - behind, dim=1).double().numpy() / (2 * STEP))
    return voxel / np.mean(steps, 0)


def typical_pixels_per_voxel(space: Space, voxel: float, views: Sequence[View], points: SparsePoints | None) -> float:
    """Pixels of a photo that a voxel spans, the median over what the photos look at.

    Args:
        space: What the voxels are cubes in.
        voxel: Their edge, grid coordinates.
        views: With cameras of the pictures' size, without a lens distortion.
        points: As these views observe them; with none, all look at the point nearest to their optical axes.
    """
    focus = focus_point([view.camera for view in views]).numpy()[None]
    no_points = points is None or not len(points.view)
    spans = [
        pixels_per_voxel(
            space, voxel, focus if no_points else points.positions[points.point[points.view == number]], view.camera
        )
        for number, view in enumerate(views)
    ]
    return float(np.nanmedian(np.concatenate(spans)))


def without_detail(photo: np.ndarray, pixels: float) -> np.ndarray:
    """A photo as voxels of this many pixels would show it: reduced by averaging, and linear in between.

    Args:
        photo: Float [H, W, 3] in [0, 1].
        pixels: >= 1.
    """
    height, width = photo.shape[:2]
    reduced = resize(photo, max(1, round(width / max(pixels, 1))), max(1, round(height / max(pixels, 1))))
    return resize(reduced, width, height)


def kept_psnr(photos: Sequence[np.ndarray], pixels: float) -> list[float]:
    """PSNR that each photo keeps without detail of this many pixels, dB: about what such voxels can reach in it."""
    return [cv2.PSNR(np.float64(without_detail(photo, pixels)), np.float64(photo), 1.0) for photo in photos]
