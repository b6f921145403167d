"""Spaces: maps from world positions to the grid coordinates of a field.

Positions, distances, boxes and normals of a field are in grid coordinates, where cells are cubes. Rays become polylines
there, `paths` [R, K, 3].

- Box: grid coordinates are world coordinates.
- Similarity: the world rotated, scaled and translated, to the scale that the encoding of an MLP expects.
- Contraction (Mip-NeRF 360, Eq. 10): with y = (x - center) / radius, `y if |y| <= 1 else (1 + b - b / |y|) y / |y|`.
  All of space becomes a ball of radius 1 + b, where b = `room`.
- Frustum (NDC of NeRF, appendix C): for forward-facing cameras. The near plane and infinity become the planes z = -1
  and z = +1 (times `depth_scale`); the width of a pixel is constant. Straight lines stay straight.

All maps are differentiable in positions and directions; the parameters of a space are not learned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from ...capture.camera import Camera
from .rays import Rays, camera_rays

CONTRACTION_VERTICES = 64
FAR = 1.002  # path parameter of infinity: the last vertex, at 1, is 1000 radii away
MIN_VIEWS = 1  # one view gives no certain depth, but requiring two would leave holes
BORDER = 0.02  # margin around an image that counts as visible, share of its sides


class Space(Protocol):
    """Map between world and grid."""

    is_forward_facing: ClassVar[bool] = False  # whether the space is for cameras that all face about the same direction

    def to_grid(self, positions: Tensor) -> Tensor:
        """Map world positions [.., 3] to grid coordinates."""
        ...

    def to_world(self, positions: Tensor) -> Tensor:
        """Map grid coordinates [.., 3] to world positions."""
        ...

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        """Return the vertices [R, K, 3] of each ray inside the grid box from `minimum` to `maximum` [3].

        They coincide for rays that miss the box.
        """
        ...


@runtime_checkable
class StraightSpace(Space, Protocol):
    """Space that keeps straight lines straight: all but the contraction."""

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Return the rays as origin + t * direction, [R, 3] each, in grid coordinates.

        t is the distance from the camera in world units; in a frustum it is 0 at the near plane and 1 at infinity.
        """
        ...

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        """Rotate unit directions [n, 3] from the world to the axes of the grid."""
        ...

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        return clipped_paths(*self.to_grid_rays(rays), minimum, maximum)


class OpenSpace(Space, Protocol):
    """Space for scenes that extend behind the object and the cameras."""

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Return the lowest and the highest corner [3] of the grid that these cameras need."""
        ...

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """Return which positions [n, 3] are seen by enough cameras, [n] bool."""
        ...


@dataclass(frozen=True)
class Box(StraightSpace):
    """The world without a transform."""

    def to_grid(self, positions: Tensor) -> Tensor:
        return positions

    def to_world(self, positions: Tensor) -> Tensor:
        return positions

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        return rays.origins, rays.viewdirs

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        return viewdirs


@dataclass(frozen=True)
class Similarity(StraightSpace):
    """The world rotated, scaled and translated."""

    world_to_grid: Tensor  # [4, 4], rotation times uniform scale, and translation

    def to_grid(self, positions: Tensor) -> Tensor:
        return positions @ self.world_to_grid[:3, :3].T + self.world_to_grid[:3, 3]

    def to_world(self, positions: Tensor) -> Tensor:
        return (positions - self.world_to_grid[:3, 3]) @ torch.linalg.inv(self.world_to_grid[:3, :3]).T

    def to_grid_rays(self, rays: Rays) -> tuple[Tensor, Tensor]:
        return self.to_grid(rays.origins), rays.viewdirs @ self.world_to_grid[:3, :3].T

    def rotate_directions(self, viewdirs: Tensor) -> Tensor:
        return torch.nn.functional.normalize(viewdirs @ self.world_to_grid[:3, :3].T, dim=-1)


@dataclass(frozen=True)
class Contraction(OpenSpace):
    """All of space contracted to a ball."""

    center: Tensor  # [3], of the inner ball, where the map is a similarity; world units
    radius: float  # of the inner ball, world units
    room: float  # thickness of the outer shell in the grid, inner radii
    near: float  # distance from the camera where rays begin, world units

    def to_grid(self, positions: Tensor) -> Tensor:
        local = (positions - self.center) / self.radius
        norm = torch.linalg.norm(local, dim=-1, keepdim=True).clamp_min(1)
        return local * ((1 + self.room - self.room / norm) / norm)

    def to_world(self, positions: Tensor) -> Tensor:
        norm = torch.linalg.norm(positions, dim=-1, keepdim=True)
        outside = self.room / (1 + self.room - norm.clamp(1, 1 + self.room * (1 - 1e-4))) / norm.clamp_min(1)
        return self.center + self.radius * positions * torch.where(norm > 1, outside, torch.ones_like(norm))

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        """Return the vertices [R, K, 3] of rays from `near` to 1000 radii, about evenly spaced in the grid."""
        # linear in t around the point closest to the center, inverse farther out
        closest = ((self.center - rays.origins) * rays.viewdirs).sum(1)
        start = (self.near - closest) / (2 * self.radius)
        start = FAR * start / (1 + start.abs())
        share = torch.linspace(0, 1, CONTRACTION_VERTICES, device=closest.device)
        u = start[:, None] + share * (1 - start)[:, None]
        t = closest[:, None] + 2 * self.radius * u / (FAR - u.abs())
        points = rays.origins[:, None] + t[..., None] * rays.viewdirs[:, None]
        return self.to_grid(points)

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Return the corners of the bounding box of the ball."""
        reach = 1 + self.room
        return torch.full_like(self.center, -reach), torch.full_like(self.center, reach)

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """Return which positions [n, 3] are in the ball and seen by at least MIN_VIEWS cameras, [n] bool."""
        world = self.to_world(positions).cpu().double().numpy()
        n_seen = np.zeros(len(world), int)
        for camera in cameras:
            pixels, depth = camera.project(world)
            size = np.array([camera.width, camera.height])
            n_seen += (depth > 0) & ((pixels > -BORDER * size) & (pixels < (1 + BORDER) * size)).all(1)
        inside = torch.linalg.norm(positions, dim=1) < 1 + self.room
        return torch.from_numpy(n_seen >= MIN_VIEWS).to(positions.device) & inside


@dataclass(frozen=True)
class Frustum(StraightSpace, OpenSpace):
    """Viewing frustum of a central camera, from a near plane to infinity."""

    world_to_camera: Tensor  # [4, 4]
    focal: Tensor  # [2], focal length over half the image width and over half the image height
    near: float  # depth of the near plane, world units
    depth_scale: float  # half the grid's depth, in half image widths
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
        """Return origins and directions [R, 3] of rays, from the near plane at t = 0 to infinity at t = 1."""
        origins = rays.origins @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        directions = self.rotate_directions(rays.viewdirs)
        forward = (-directions[:, 2:]).clamp_min(1e-6)
        start = origins + ((self.near + origins[:, 2:]) / forward).clamp_min(0) * directions  # on the near plane
        depth = -start[:, 2:]
        plane = self.focal * start[:, :2] / depth
        first = torch.cat([plane, self.depth_scale * (1 - 2 * self.near / depth)], 1)
        last = torch.cat([self.focal * directions[:, :2] / forward, torch.full_like(depth, self.depth_scale)], 1)
        faces_back = directions[:, 2:] > -1e-3
        last = torch.where(faces_back, first, last)
        return first, last - first

    def grid_bounds(self, cameras: list[Camera]) -> tuple[Tensor, Tensor]:
        """Return the corners [3] of the box that the cameras see, from the near plane to infinity."""
        device, corner_paths = self.focal.device, []
        unbounded = torch.full((3,), torch.inf, device=device)
        for camera in cameras:
            corners = [0, camera.width - 1, (camera.height - 1) * camera.width, camera.height * camera.width - 1]
            rays = camera_rays(camera.without_distortion(), device)[corners]
            corner_paths.append(self.paths(rays, -unbounded, unbounded).reshape(-1, 3))
        ends = torch.cat(corner_paths)
        low, high = ends.amin(0), ends.amax(0)
        low[2], high[2] = -self.depth_scale, self.depth_scale
        return low, high

    def is_seen(self, positions: Tensor, cameras: list[Camera]) -> Tensor:
        """Return True for all positions: all cameras face about the same direction."""
        return torch.ones(len(positions), dtype=torch.bool, device=positions.device)


def clipped_paths(
    origins: Tensor, directions: Tensor, minimum: Tensor, maximum: Tensor, longest: float | None = None
) -> Tensor:
    """Clip lines origin + t * direction, 0 <= t <= longest, to a box; origins and directions are [R, 3], corners [3].

    Returns the first and last points [R, 2, 3]; equal where a line misses the box.
    """
    # avoid 0 * inf = nan on the faces of the box
    safe = torch.where(directions.abs() < 1e-9, torch.full_like(directions, 1e-9), directions)
    first = (minimum - origins) / safe
    second = (maximum - origins) / safe
    near = torch.minimum(first, second).amax(1).clamp_min(0)
    far = torch.maximum(first, second).amin(1)
    if longest is not None:
        far = far.clamp_max(longest)
    far = torch.maximum(near, far)
    return origins[:, None] + torch.stack([near, far], 1)[..., None] * directions[:, None]


SPACES: dict[str, type] = {"box": Box, "similarity": Similarity, "contraction": Contraction, "frustum": Frustum}
# shapes of the tensors; all other attributes are numbers
SHAPES = {"world_to_grid": (4, 4), "world_to_camera": (4, 4), "center": (3,), "focal": (2,)}
AnySpace = TypeVar("AnySpace", bound=Space)


def space_to_json(space: Space) -> dict[str, Any]:
    """Convert a space to JSON values: its `kind` and its attributes, tensors as nested lists."""
    values = {name: v.tolist() if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return {"kind": type(space).__name__.lower(), **values}


def space_from_json(content: dict[str, Any], device: torch.device | str = "cpu") -> Space:
    """Restore a space from `space_to_json`.

    Raises:
        ValueError, KeyError, TypeError: The values do not describe a space.
    """
    values = {
        name: torch.tensor(v, device=device) if isinstance(v, list) else float(v)
        for name, v in content.items()
        if name != "kind"
    }
    for name, value in values.items():
        if isinstance(value, Tensor) != (name in SHAPES) or getattr(value, "shape", None) != SHAPES.get(name):
            raise ValueError(f"a space whose {name} is {content[name]!r:.100}")
    return SPACES[content["kind"]](**values)


def space_to_device(space: AnySpace, device: torch.device | str) -> AnySpace:
    """Copy a space to a device."""
    values = {name: v.to(device) if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return type(space)(**values)
