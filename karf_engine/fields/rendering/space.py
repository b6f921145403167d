"""Where a field lies in the world: in a box round an object, in a contraction of all space, or in a camera frustum.

A space maps world positions to grid coordinates, in which cells are cubes. Everything learned lives in grid coordinates:
distances between points, boxes and normals are theirs too. Rays become polylines there, `paths` [R, K, 3].

- Box: grid coordinates are the world's.
- Similarity: the world rotated, scaled and moved, as an MLP wants it, whose encoding has a scale of its own.
- Contraction (Mip-NeRF 360, Eq. 10): with y = (x - center) / radius, `y where |y| <= 1, else (1 + b - b / |y|) y / |y|`. All
  of space becomes a ball of radius 1 + b; b = `room` is the share of it that what lies outside gets.
- Frustum (NDC of NeRF, appendix C): for cameras that look about the same way. The near plane and infinity are the
  planes z = -1 and z = +1 (times `depth_scale`); a pixel is as wide anywhere. Straight lines stay straight.

Positions and directions are differentiable throughout; what a space itself is made of is not learned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import torch
from torch import Tensor

from ...capture.camera import Camera
from .rays import Rays, camera_rays

CONTRACTION_KNOTS = 64
FAR = 1.002  # of a path's parameter at infinity: the last knot, at 1, is 1000 radii away
MIN_VIEWS = 1  # that see a place: what one photo alone shows has no certain depth, but a hole would show in others
BORDER = 0.02  # of a picture's sides: what lies this far outside it counts as seen


class Space(Protocol):
    """Any space. is_forward_facing: made for cameras that look about the same way."""

    is_forward_facing: ClassVar[bool]

    def to_grid(self, positions: Tensor) -> Tensor:
        """Grid coordinates of world positions [.., 3]."""

    def to_world(self, positions: Tensor) -> Tensor:
        """World positions of grid coordinates [.., 3]."""

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        """Knots of each ray within the grid from corner `minimum` to `maximum` [3], [R, K, 3] grid coordinates; they
        coincide where it misses the grid."""


class StraightSpace(Space, Protocol):
    """A space in which straight lines stay straight: all but the contraction."""

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Origins and directions [R, 3] of the rays as origin + t direction, grid coordinates. The directions' length
        says what t means: the world's distance from the camera, but in a frustum 0 to 1 from near plane to infinity."""

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        """Unit viewing directions [n, 3] of the world in the axes of the grid."""


class OpenSpace(Space, Protocol):
    """A space for scenes that extend behind the object and the cameras."""

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Lowest and highest corner [3] of the grid that these cameras need, grid coordinates."""

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """True for the positions [n, 3], grid coordinates, that enough cameras see, [n]."""


@dataclass(frozen=True)
class Box:
    """The world as it is."""

    is_forward_facing: ClassVar[bool] = False

    def to_grid(self, positions: Tensor) -> Tensor:
        return positions

    def to_world(self, positions: Tensor) -> Tensor:
        return positions

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        return clipped_paths(*self.to_grid_rays(rays), minimum, maximum)

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        return rays.origins, rays.viewdirs

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        return viewdirs


@dataclass(frozen=True)
class Similarity:
    """The world rotated, scaled and moved.

    Attributes:
        world_to_grid: [4, 4], a rotation times a uniform scale, and a shift.
    """

    world_to_grid: Tensor
    is_forward_facing: ClassVar[bool] = False

    def to_grid(self, positions: Tensor) -> Tensor:
        return positions @ self.world_to_grid[:3, :3].T + self.world_to_grid[:3, 3]

    def to_world(self, positions: Tensor) -> Tensor:
        return (positions - self.world_to_grid[:3, 3]) @ torch.linalg.inv(self.world_to_grid[:3, :3]).T

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        return clipped_paths(*self.to_grid_rays(rays), minimum, maximum)

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        return self.to_grid(rays.origins), rays.viewdirs @ self.world_to_grid[:3, :3].T

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        return torch.nn.functional.normalize(viewdirs @ self.world_to_grid[:3, :3].T, dim=-1)


@dataclass(frozen=True)
class Contraction:
    """All of space in a ball.

    Attributes:
        center: [3], of the inner ball, which keeps its shape; world units.
        radius: Of the inner ball, world units.
        room: Radius that what lies outside gets in the grid, in inner radii.
        near: Distance from the camera before which nothing is looked for, world units.
    """

    center: Tensor
    radius: float
    room: float
    near: float
    is_forward_facing: ClassVar[bool] = False

    def to_grid(self, positions: Tensor) -> Tensor:
        local = (positions - self.center) / self.radius
        norm = torch.linalg.norm(local, dim=-1, keepdim=True).clamp_min(1)
        return local * ((1 + self.room - self.room / norm) / norm)

    def to_world(self, positions: Tensor) -> Tensor:
        norm = torch.linalg.norm(positions, dim=-1, keepdim=True)
        outside = self.room / (1 + self.room - norm.clamp(1, 1 + self.room * (1 - 1e-4))) / norm.clamp_min(1)
        return self.center + self.radius * positions * torch.where(norm > 1, outside, torch.ones_like(norm))

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        """Knots from `near` to far out, [R, K, 3], about equally far apart in grid coordinates."""
        # evenly round the place nearest to the center, and then as one over what is left
        closest = ((self.center - rays.origins) * rays.viewdirs).sum(1)
        start = (self.near - closest) / (2 * self.radius)
        start = FAR * start / (1 + start.abs())
        share = torch.linspace(0, 1, CONTRACTION_KNOTS, device=closest.device)
        u = start[:, None] + share * (1 - start)[:, None]
        t = closest[:, None] + 2 * self.radius * u / (FAR - u.abs())
        points = rays.origins[:, None] + t[..., None] * rays.viewdirs[:, None]
        return self.to_grid(points)

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Corners of the whole ball."""
        reach = 1 + self.room
        return torch.full_like(self.center, -reach), torch.full_like(self.center, reach)

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """True where at least MIN_VIEWS cameras see a position [n, 3] of the ball, [n]."""
        world = self.to_world(positions).double().cpu().numpy()
        n_seen = np.zeros(len(world), int)
        for camera in cameras:
            pixels, depth = camera.project(world)
            size = np.array([camera.width, camera.height])
            n_seen += (depth > 0) & ((pixels > -BORDER * size) & (pixels < (1 + BORDER) * size)).all(1)
        inside = torch.linalg.norm(positions, dim=1) < 1 + self.room
        return torch.from_numpy(n_seen >= MIN_VIEWS).to(positions.device) & inside


@dataclass(frozen=True)
class Frustum:
    """What lies before a camera amid all.

    Attributes:
        world_to_camera: [4, 4], of that camera.
        focal: [2], focal length over half the picture's width and over half its height.
        near: Depth of the near plane, world units.
        depth_scale: Half the grid's depth, in half picture widths.
    """

    world_to_camera: Tensor
    focal: Tensor
    near: float
    depth_scale: float
    is_forward_facing: ClassVar[bool] = True

    def to_grid(self, positions: Tensor) -> Tensor:
        local = positions @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        depth = (-local[..., 2:]).clamp_min(1e-3 * self.near)
        plane = self.focal * local[..., :2] / depth
        return torch.cat([plane, self.depth_scale * (1 - 2 * self.near / depth)], -1)

    def to_world(self, positions: Tensor) -> Tensor:
        depth = 2 * self.near / (1 - positions[..., 2:] / self.depth_scale).clamp_min(1e-4)
        local = torch.cat([positions[..., :2] * depth / self.focal, -depth], -1)
        camera_to_world = torch.linalg.inv(self.world_to_camera)
        return local @ camera_to_world[:3, :3].T + camera_to_world[:3, 3]

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        return clipped_paths(*self.to_grid_rays(rays), minimum, maximum, longest=1.0)

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        return viewdirs @ self.world_to_camera[:3, :3].T

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Origins and directions [R, 3] of the rays, from the near plane at t = 0 to infinity at t = 1."""
        origins = rays.origins @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        directions = self.rotate_directions(rays.viewdirs)
        forward = (-directions[:, 2:]).clamp_min(1e-6)
        start = origins + ((self.near + origins[:, 2:]) / forward).clamp_min(0) * directions  # at the near plane
        depth = -start[:, 2:]
        plane = self.focal * start[:, :2] / depth
        # at infinity only the direction counts
        first = torch.cat([plane, self.depth_scale * (1 - 2 * self.near / depth)], 1)
        last = torch.cat([self.focal * directions[:, :2] / forward, torch.full_like(depth, self.depth_scale)], 1)
        looks_back = directions[:, 2:] > -1e-3
        last = torch.where(looks_back, first, last)
        return first, last - first

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Corners [3] round what the cameras see, from the near plane to infinity."""
        device, ends = self.focal.device, []
        farthest = torch.full((3,), torch.inf, device=device)
        for camera in cameras:
            corners = [0, camera.width - 1, (camera.height - 1) * camera.width, camera.height * camera.width - 1]
            rays = camera_rays(camera.without_distortion(), device)[corners]
            ends.append(self.paths(rays, -farthest, farthest).reshape(-1, 3))
        ends = torch.cat(ends)
        low, high = ends.amin(0), ends.amax(0)
        low[2], high[2] = -self.depth_scale, self.depth_scale
        return low, high

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """True everywhere: all cameras look about the same way."""
        return torch.ones(len(positions), dtype=torch.bool, device=positions.device)


def clipped_paths(
    origins: Tensor, directions: Tensor, minimum: Tensor, maximum: Tensor, longest: float | None = None
) -> Tensor:
    """First and last point within a box of the lines origin + t direction.

    Args:
        origins: [R, 3].
        directions: [R, 3], of any length.
        minimum: [3], lowest corner of the box.
        maximum: [3], highest corner of the box.
        longest: Largest t; None for any. The smallest is 0.

    Returns:
        Points [R, 2, 3]; both are the same where a line misses the box.

    Example:
        >>> origin, direction = torch.tensor([[0.0, 0.0, -3.0]]), torch.tensor([[0.0, 0.0, 1.0]])
        >>> clipped_paths(origin, direction, -torch.ones(3), torch.ones(3))
        tensor([[[ 0.,  0., -1.],
                 [ 0.,  0.,  1.]]])
    """
    # a zero component would give 0 * inf = nan on a box face
    safe = torch.where(directions.abs() < 1e-9, torch.full_like(directions, 1e-9), directions)
    first = (minimum - origins) / safe
    second = (maximum - origins) / safe
    near = torch.minimum(first, second).amax(1).clamp_min(0)
    far = torch.maximum(first, second).amin(1)
    if longest is not None:
        far = far.clamp_max(longest)
    far = torch.maximum(near, far)
    return origins[:, None] + torch.stack([near, far], 1)[..., None] * directions[:, None]
