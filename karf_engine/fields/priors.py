"""Priors of a scene before it is learned: free space, the horizon, and cells whose color agrees between photos."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from .extent import is_reliable, reliable_points, upright_axes
from .rendering.rays import PixelDataset

FREE_SHARE = 0.85  # free depth of a view, share of its smallest depth
CLEAR_SHARE = 0.5  # free radius around a camera, share of the distance to its nearest point
FEWEST_POINTS = 50  # points needed to estimate a smallest depth
OUTLIERS = 0.005  # share of these points that are nearer by mistake
POSITIONS_PER_CHUNK = 1 << 16
# cameras face -z with y up; pixel rows count down and depth forward
AHEAD = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]])
SECTORS = 36  # of the azimuth
MARGIN = math.radians(0.5)  # above the highest point of a sector, radians
COLOR_TOLERANCE = 0.15  # difference per channel between photos that agree, sRGB
AGREEING_SHARE = 0.6  # of the photos that see a cell
MIN_SHARE = 0.25  # of all photos


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


@dataclass(frozen=True)
class Horizon:
    """Elevation of the sky, whose color depends on the direction alone, in each azimuth sector."""

    axes: Tensor  # [3, 3], rows: two horizontal directions and up
    elevations: Tensor  # [SECTORS], radians

    def to(self, device: torch.device) -> Horizon:
        """Copy the horizon to a device."""
        return Horizon(self.axes.to(device), self.elevations.to(device))

    def is_sky(self, viewdirs: Tensor) -> Tensor:
        """Return whether unit directions [n, 3] point above the horizon, [n] bool."""
        x, y, z = (viewdirs @ self.axes.T).unbind(1)
        return z.clamp(-1, 1).asin() > self.elevations[_sectors(x, y)]


def _sectors(x: Tensor, y: Tensor) -> Tensor:
    """Return the azimuth sector of horizontal directions."""
    return ((torch.atan2(y, x) / (2 * math.pi) + 0.5) * SECTORS).long().clamp_max(SECTORS - 1)


def estimate_horizon(cameras: list[Camera], points: SparsePoints | None, center: Tensor, radius: float) -> Horizon:
    """Compute the largest elevation of points outside a ball in each sector and its neighbors, at least 0.

    The cameras are roughly upright; the points are as they observe them. The ball has a center [3] and a radius in
    world units.
    """
    axes = upright_axes(cameras)
    elevations = torch.zeros(SECTORS)
    if points is not None and len(points.view):
        far = np.linalg.norm(points.positions - center.cpu().numpy(), axis=1) > radius
        seen = (far & is_reliable(points))[points.point]
        positions = np.stack([camera.position for camera in cameras])[points.view[seen]]
        x, y, z = torch.from_numpy((points.positions[points.point[seen]] - positions) @ axes.T).float().unbind(1)
        elevations = elevations.scatter_reduce(0, _sectors(x, y), torch.atan2(z, torch.hypot(x, y)) + MARGIN, "amax")
        elevations = torch.stack([elevations.roll(1), elevations, elevations.roll(-1)]).amax(0)
    return Horizon(torch.from_numpy(axes).float(), elevations)


def is_photo_consistent(dataset: PixelDataset, points: Tensor, voxel: float) -> Tensor:
    """Return which cells have the same color in most photos that see them, [n] bool.

    A cell on a surface has (voxel coloring, Seitz and Dyer 1997; here in a share of the photos, since occlusion is
    still unknown). Fog that explains the background of one photo has not.

    Args:
        dataset: The photos.
        points: Cell centers [n, 3] float32, world units.
        voxel: Cell size, world units; colors are averaged over a square of this size.
    """
    n_views = len(dataset.cameras)
    samples = [_project(dataset, number, points, voxel) for number in range(n_views)]
    colors, is_seen = (torch.stack(each, 1) for each in zip(*samples, strict=True))
    n_agreeing = torch.zeros(len(points), device=points.device)
    for number in range(n_views):
        is_alike = (colors - colors[:, number : number + 1]).abs().amax(2) < COLOR_TOLERANCE
        n_agreeing = torch.maximum(n_agreeing, (is_alike & is_seen).sum(1) * is_seen[:, number])
    return n_agreeing >= (AGREEING_SHARE * is_seen.sum(1)).clamp_min(MIN_SHARE * n_views)


def _project(dataset: PixelDataset, number: int, points: Tensor, voxel: float) -> tuple[Tensor, Tensor]:
    """Return a photo's colors at points, sRGB [n, 3], and whether the points are in its image, [n] bool."""
    camera = dataset.cameras[number]
    first, last = int(dataset.offsets[number]), int(dataset.offsets[number + 1])
    photo = dataset.color[first:last].float().view(1, camera.height, camera.width, 3).permute(0, 3, 1, 2) / 255
    world_to_camera = torch.from_numpy(camera.world_to_camera).to(points)
    local = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    depth = -local[:, 2]
    u = (camera.cx + camera.fx * local[:, 0] / depth.clamp_min(1e-6)).floor()
    v = (camera.cy - camera.fy * local[:, 1] / depth.clamp_min(1e-6)).floor()
    is_seen = (depth > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    if is_seen.any():
        radius = round(camera.fx * voxel / float(depth[is_seen].median()) / 2)
        padded = nn.functional.pad(photo, (radius,) * 4, mode="replicate")
        photo = nn.functional.avg_pool2d(padded, 2 * radius + 1, 1)
    rows, columns = v.long().clamp(0, camera.height - 1), u.long().clamp(0, camera.width - 1)
    return photo[0, :, rows, columns].T, is_seen


def rotate_about_vertical(viewdirs: Tensor, axes: Tensor, turns: Tensor) -> Tensor:
    """Rotate directions [n, 3] about the vertical axis by shares of a full turn [n] in [0, 1].

    The rows of `axes` [3, 3] are two horizontal directions and up.
    """
    x, y, z = (viewdirs @ axes.T).unbind(1)
    cos, sin = torch.cos(2 * math.pi * turns), torch.sin(2 * math.pi * turns)
    return torch.stack([x * cos - y * sin, x * sin + y * cos, z], 1) @ axes
