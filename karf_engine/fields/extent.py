"""The extent of a scene, estimated from cameras and sparse points."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View

FORWARD_FACING = 30.0  # degrees; largest angle between an optical axis and their mean
NEAREST = 0.01  # quantile of a camera's point depths; nearer points are outliers
FARTHEST = 0.99  # quantile of a camera's point depths; farther points are outliers
RELIABLE_ERROR = 1.5  # pixels of reprojection error above the median; points beyond are unreliable
FEWEST_VIEWS = 3  # views that must observe a reliable point: two may agree on a mismatch


def is_forward_facing(cameras: list[Camera]) -> bool:
    """Return whether cameras are forward-facing: all optical axes are near their mean."""
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    mean = axes.mean(0)
    return bool((axes @ mean >= np.cos(np.radians(FORWARD_FACING)) * np.linalg.norm(mean)).all())


def focus_point(cameras: list[Camera]) -> Tensor:
    """Return the point [3] float64 closest to all optical axes, by least squares."""
    poses = torch.stack([torch.from_numpy(c.camera_to_world) for c in cameras])
    axes = nn.functional.normalize(-poses[:, :3, 2], dim=1)
    projectors = torch.eye(3, dtype=axes.dtype) - axes[:, :, None] * axes[:, None, :]
    # a slight pull to the mean camera position makes the system solvable for parallel axes
    pull = 1e-6 * torch.eye(3, dtype=axes.dtype) * len(cameras)
    right = (projectors @ poses[:, :3, 3, None]).sum(0)[:, 0] + pull @ poses[:, :3, 3].mean(0)
    return torch.linalg.solve(projectors.sum(0) + pull, right)


def box_around_focus(cameras: list[Camera], reach: float) -> tuple[Tensor, float]:
    """Return a cube around the focus point: center [3] float64 and half-width, world units.

    `reach` is its half-width in median half-widths of the visible area at the focus point.
    """
    center = focus_point(cameras)
    half_widths = [
        float(torch.linalg.norm(torch.from_numpy(c.position) - center)) * max(c.width / c.fx, c.height / c.fy) / 2
        for c in cameras
    ]
    return center, reach * sorted(half_widths)[len(half_widths) // 2]


def upright_axes(cameras: list[Camera]) -> np.ndarray:
    """Return two horizontal directions and up, rows [3, 3], of cameras with roughly horizontal x axes."""
    right = np.stack([camera.camera_to_world[:3, 0] for camera in cameras])
    axes = np.linalg.eigh(right.T @ right)[1].T[::-1].copy()  # the last is perpendicular to most x axes
    axes[2] *= np.sign(axes[2] @ sum(camera.camera_to_world[:3, 1] for camera in cameras))
    return axes


def mean_pose(cameras: list[Camera]) -> np.ndarray:
    """Return the mean camera-to-world pose [4, 4] (LLFF's recentering)."""
    poses = np.stack([camera.camera_to_world for camera in cameras])
    back = poses[:, :3, 2].mean(0)
    right = np.cross(poses[:, :3, 1].mean(0), back)
    middle = np.eye(4)
    middle[:3, 2] = back / np.linalg.norm(back)
    middle[:3, 0] = right / np.linalg.norm(right)
    middle[:3, 1] = np.cross(middle[:3, 2], middle[:3, 0])
    middle[:3, 3] = poses[:, :3, 3].mean(0)
    return middle


def min_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Return the smallest depth in any view, world units: as declared, else from sparse points, else None."""
    declared = [view.depth_bounds[0] for view in views if view.depth_bounds]
    return min(declared or _point_depths(views, points, NEAREST), default=None)


def max_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Return the largest depth in any view, world units, as `min_depth` does."""
    declared = [view.depth_bounds[1] for view in views if view.depth_bounds]
    return max(declared or _point_depths(views, points, FARTHEST), default=None)


def reliable_points(points: SparsePoints) -> np.ndarray:
    """Return the positions [n, 3] of points with a small error and at least FEWEST_VIEWS observations."""
    observed = np.bincount(points.point, minlength=len(points)) >= FEWEST_VIEWS
    return points.positions[observed & is_reliable(points)]


def is_reliable(points: SparsePoints) -> np.ndarray:
    """Return whether the reprojection error of each point is small or unknown, [n] bool."""
    return ~(points.errors > np.nanmedian(points.errors) + RELIABLE_ERROR)


def _point_depths(views: list[View], points: SparsePoints | None, quantile: float) -> list[float]:
    """Return this quantile of the point depths of each camera that observes points."""
    found = []
    if points is None:
        return found
    for number, view in enumerate(views):
        _, depth = view.camera.project(points.positions[points.point[points.view == number]])
        if (depth > 0).any():
            found.append(float(np.quantile(depth[depth > 0], quantile)))
    return found
