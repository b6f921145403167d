"""Where in the world a scene lies, estimated from cameras and sparse points."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View

SAME_WAY = 30.0  # degrees between each camera's axis and their mean up to which cameras look one way
NEAREST = 0.01  # share of a camera's sparse points that may be nearer than its nearest depth: mistakes
FARTHEST = 0.99  # share of a camera's sparse points that its farthest depth must include: the rest are mistakes
RELIABLE_ERROR = 1.5  # pixels of reprojection error above the median beyond which points are left out
FEWEST_VIEWS = 3  # views that must observe a reliable point: two may agree on a mistake


def looks_one_way(cameras: list[Camera]) -> bool:
    """Whether all optical axes are within SAME_WAY of their mean."""
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    mean = axes.mean(0)
    return bool((axes @ mean >= np.cos(np.radians(SAME_WAY)) * np.linalg.norm(mean)).all())


def focus_point(cameras: list[Camera]) -> Tensor:
    """The point nearest to all optical axes in the least-squares sense, [3] float64."""
    poses = torch.stack([torch.from_numpy(c.camera_to_world) for c in cameras])
    axes = -poses[:, :3, 2]
    axes = nn.functional.normalize(axes, dim=1)
    projectors = torch.eye(3, dtype=axes.dtype) - axes[:, :, None] * axes[:, None, :]
    # parallel axes have no nearest point: a little pull to the cameras' middle keeps the system solvable
    pull = 1e-6 * torch.eye(3, dtype=axes.dtype) * len(cameras)
    right = (projectors @ poses[:, :3, 3, None]).sum(0)[:, 0] + pull @ poses[:, :3, 3].mean(0)
    return torch.linalg.solve(projectors.sum(0) + pull, right)


def box_round_focus(cameras: list[Camera], reach: float) -> tuple[Tensor, float]:
    """A cube round the cameras' focus point.

    Args:
        cameras: At least one.
        reach: Half-width in units of what a typical camera sees, from the picture's middle to its wider edge, there.

    Returns:
        Center [3] float64 and half-width, world units.
    """
    center = focus_point(cameras)
    half_widths = [
        float(torch.linalg.norm(torch.from_numpy(c.position) - center)) * max(c.width / c.fx, c.height / c.fy) / 2
        for c in cameras
    ]
    return center, reach * sorted(half_widths)[len(half_widths) // 2]


def upright_axes(cameras: list[Camera]) -> np.ndarray:
    """Two horizontal directions and up, rows [3, 3], of cameras that are held upright, more or less."""
    right = np.stack([camera.camera_to_world[:3, 0] for camera in cameras])
    axes = np.linalg.eigh(right.T @ right)[1].T[::-1].copy()  # the last is the most upright
    axes[2] *= np.sign(axes[2] @ sum(camera.camera_to_world[:3, 1] for camera in cameras))
    return axes


def middle_pose(cameras: list[Camera]) -> np.ndarray:
    """Camera to world [4, 4] of a camera amid all, oriented as they are on average (LLFF's recentering)."""
    poses = np.stack([camera.camera_to_world for camera in cameras])
    back = poses[:, :3, 2].mean(0)
    right = np.cross(poses[:, :3, 1].mean(0), back)
    middle = np.eye(4)
    middle[:3, 2] = back / np.linalg.norm(back)
    middle[:3, 0] = right / np.linalg.norm(right)
    middle[:3, 1] = np.cross(middle[:3, 2], middle[:3, 0])
    middle[:3, 3] = poses[:, :3, 3].mean(0)
    return middle


def nearest_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Depth of the nearest thing before any camera, world units: as declared, else of its sparse points, else None.

    Args:
        views: With depth bounds where the capture declares them.
        points: As these views observe them. The nearest NEAREST of a camera's points are taken for mistakes.
    """
    declared = [view.depth_bounds[0] for view in views if view.depth_bounds]
    return min(declared or _point_depths(views, points, NEAREST), default=None)


def farthest_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Depth of the farthest thing before any camera, world units, likewise."""
    declared = [view.depth_bounds[1] for view in views if view.depth_bounds]
    return max(declared or _point_depths(views, points, FARTHEST), default=None)


def reliable_points(points: SparsePoints) -> np.ndarray:
    """Positions [n, 3] of the points that at least FEWEST_VIEWS observe, and with no large error."""
    observed = np.bincount(points.point, minlength=len(points)) >= FEWEST_VIEWS
    return points.positions[observed & is_reliable(points)]


def is_reliable(points: SparsePoints) -> np.ndarray:
    """Whether a point's reprojection error is small or unknown, bool [n]."""
    return ~(points.errors > np.nanmedian(points.errors) + RELIABLE_ERROR)


def _point_depths(views: list[View], points: SparsePoints | None, quantile: float) -> list[float]:
    """This quantile of the depths of each camera's sparse points, where it sees some."""
    found = []
    for number, view in enumerate(views if points is not None else ()):
        _, depth = view.camera.project(points.positions[points.point[points.view == number]])
        if (depth > 0).any():
            found.append(float(np.quantile(depth[depth > 0], quantile)))
    return found
