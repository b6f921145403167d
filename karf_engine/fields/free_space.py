"""Where cameras see through, and where they stood: nothing is looked for there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from .extent import reliable_points

FREE_SHARE = 0.85  # share of a view's nearest depth that is free: all that it sees lies behind
ROUND_CAMERA = 0.5  # share of the distance from a camera to its nearest point within which nothing stands
FEWEST_POINTS = 50  # points needed to estimate how near the nearest thing is
MISTAKEN = 0.005  # share of these points that may be nearer: mistakes
POSITIONS_AT_ONCE = 1 << 16
# our cameras look down -z, y is up; pixels count down and depth ahead
AHEAD = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]])


@dataclass(frozen=True)
class FreeSpace:
    """What some cameras see through, up to a depth of their own, and a ball round each of them.

    Nothing can be in front of a camera, though its photo alone would be explained as well by a picture hung up right
    before it: the longer the lens, the less of the space before it do others see. Nor can there be anything round it,
    though the cameras across the scene would take fog there for what is behind the scene.

    Attributes:
        projections: [V, 3, 4] float32, from world positions to column times depth, row times depth, and depth.
        limits: [V, 3] float32, of columns and rows (pixels) and of depth (world units).
        balls: [V, 4] float32, centers and radii, world units.
    """

    projections: Tensor
    limits: Tensor
    balls: Tensor

    @classmethod
    def of(cls, views: list[View], points: SparsePoints | None, device: torch.device | str = "cpu") -> FreeSpace:
        """The free space that the cameras of these views, without lens distortion, and their sparse points imply."""
        cameras = [view.camera for view in views]
        projections = [
            np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]]) @ AHEAD @ c.world_to_camera for c in cameras
        ]
        limits = [[c.width, c.height, depth] for c, depth in zip(cameras, free_depths(views, points), strict=True)]
        balls = [[*c.position, radius] for c, radius in zip(cameras, clear_radii(cameras, points), strict=True)]
        return cls(
            *(torch.tensor(np.array(of), dtype=torch.float32, device=device) for of in (projections, limits, balls))
        )

    def holds(self, positions: Tensor) -> Tensor:
        """Whether places [n, 3] float32, world units, are free, bool [n]."""
        return torch.cat([self._holds(some) for some in positions.split(POSITIONS_AT_ONCE)])

    def _holds(self, positions: Tensor) -> Tensor:
        free = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
        for projection, (width, height, farthest), ball in zip(
            self.projections, self.limits.tolist(), self.balls, strict=True
        ):
            column, row, depth = (projection[:, :3] @ positions.T + projection[:, 3:]).unbind(0)
            is_seen = (column > 0) & (column < width * depth) & (row > 0) & (row < height * depth)
            free |= is_seen & (depth < farthest)
            free |= ((positions - ball[:3]) ** 2).sum(1) < ball[3] ** 2
        return free


def free_depths(views: list[View], points: SparsePoints | None) -> list[float]:
    """Depth up to which each view sees nothing, world units; 0 where that is not known.

    It is FREE_SHARE of the view's declared nearest depth, or of that of the sparse points in its picture where that is
    less. All points count, not just those that the view observes: what is near may have features only in other views.
    """
    positions = _reliable_positions(points)
    depths = []
    for view in views:
        pixels, depth = view.camera.project(positions)
        depth = np.sort(depth[_in_picture(view.camera, pixels, depth)])
        known = [view.depth_bounds[0]] if view.depth_bounds else []
        if len(depth) >= FEWEST_POINTS:
            known.append(depth[int(MISTAKEN * len(depth))])
        depths.append(FREE_SHARE * float(min(known, default=0.0)))
    return depths


def clear_radii(cameras: list[Camera], points: SparsePoints | None) -> list[float]:
    """Distance from each camera up to which nothing stands in any direction, world units; 0 where that is not known."""
    positions = _reliable_positions(points)
    if len(positions) < FEWEST_POINTS:
        return [0.0] * len(cameras)
    nearest = int(MISTAKEN * len(positions))
    distances = (np.linalg.norm(positions - camera.position, axis=1) for camera in cameras)
    return [ROUND_CAMERA * float(np.partition(each, nearest)[nearest]) for each in distances]


def _reliable_positions(points: SparsePoints | None) -> np.ndarray:
    return np.zeros((0, 3)) if points is None or not len(points) else reliable_points(points)


def _in_picture(camera: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    return (depth > 0) & ((pixels > 0) & (pixels < (camera.width, camera.height))).all(1)
