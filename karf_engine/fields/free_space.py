"""Free space: what cameras see through, and a ball around each of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from .extent import reliable_points

FREE_SHARE = 0.85  # free depth of a view, share of its smallest depth
CLEAR_SHARE = 0.5  # free radius around a camera, share of the distance to its nearest point
FEWEST_POINTS = 50  # points needed to estimate a smallest depth
OUTLIERS = 0.005  # share of these points that are nearer by mistake
POSITIONS_PER_CHUNK = 1 << 16
# cameras face -z with y up; pixel rows count down and depth forward
AHEAD = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]])


@dataclass(frozen=True)
class FreeSpace:
    """The free part of each camera's view frustum, and a free ball around each camera.

    It rules out a picture directly in front of a camera, which explains its photo as well as the scene does, and fog
    around a camera, which distant cameras may mistake for the background.
    """

    projections: Tensor  # [V, 3, 4] float32, from world positions to column * depth, row * depth, and depth
    limits: Tensor  # [V, 3] float32, largest column and row (pixels) and depth (world units)
    balls: Tensor  # [V, 4] float32, centers and radii, world units

    @classmethod
    def from_views(
        cls, views: list[View], points: SparsePoints | None, device: torch.device | str = "cpu"
    ) -> FreeSpace:
        """Build the free space of views without lens distortion and of their sparse points."""
        cameras = [view.camera for view in views]
        projections = [
            np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]]) @ AHEAD @ c.world_to_camera for c in cameras
        ]
        limits = [[c.width, c.height, depth] for c, depth in zip(cameras, free_depths(views, points), strict=True)]
        balls = [[*c.position, radius] for c, radius in zip(cameras, clear_radii(cameras, points), strict=True)]
        return cls(
            *(torch.tensor(np.array(rows), dtype=torch.float32, device=device) for rows in (projections, limits, balls))
        )

    def contains(self, positions: Tensor) -> Tensor:
        """Return whether positions [n, 3] float32, world units, are free, [n] bool."""
        return torch.cat([self._contains(some) for some in positions.split(POSITIONS_PER_CHUNK)])

    def _contains(self, positions: Tensor) -> Tensor:
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
    """Return the free depth of each view, world units; 0 if unknown.

    It is FREE_SHARE of the declared smallest depth, or of that of sparse points in the image if smaller. Points that
    the view does not observe count too: near objects may only have features in other views.
    """
    positions = _reliable_positions(points)
    depths = []
    for view in views:
        pixels, depth = view.camera.project(positions)
        size = view.camera.width, view.camera.height
        depth = np.sort(depth[(depth > 0) & ((pixels > 0) & (pixels < size)).all(1)])
        known = [view.depth_bounds[0]] if view.depth_bounds else []
        if len(depth) >= FEWEST_POINTS:
            known.append(depth[int(OUTLIERS * len(depth))])
        depths.append(FREE_SHARE * float(min(known, default=0.0)))
    return depths


def clear_radii(cameras: list[Camera], points: SparsePoints | None) -> list[float]:
    """Return the free radius around each camera, world units; 0 if unknown."""
    positions = _reliable_positions(points)
    if len(positions) < FEWEST_POINTS:
        return [0.0] * len(cameras)
    nearest = int(OUTLIERS * len(positions))
    distances = (np.linalg.norm(positions - camera.position, axis=1) for camera in cameras)
    return [CLEAR_SHARE * float(np.partition(each, nearest)[nearest]) for each in distances]


def _reliable_positions(points: SparsePoints | None) -> np.ndarray:
    return np.zeros((0, 3)) if points is None or not len(points) else reliable_points(points)
