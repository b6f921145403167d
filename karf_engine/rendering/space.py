"""Where a field lies in the world: in a box round an object, in a contraction of all space, or in a camera frustum.

A space maps world positions to grid coordinates, in which cells are cubes. Everything learned lives in grid coordinates:
distances between points, boxes and normals are theirs too. Rays become polylines there, `paths` [R, K, 3].

- Box: grid coordinates are the world's.
- Similarity: the world turned, moved and scaled, as an MLP wants it, whose encoding has a scale of its own.
- Contraction (Mip-NeRF 360, Eq. 10): with y = (x - center) / radius, `y where |y| <= 1, else (1 + b - b / |y|) y / |y|`. All
  of space becomes a ball of radius 1 + b; b = `room` is the share of it that what lies outside gets.
- Frustum (NDC of NeRF, appendix C): for cameras that look about the same way. The near plane and infinity are the
  planes z = -1 and z = +1 (times `depth_scale`); a pixel is as wide anywhere. Straight lines stay straight.

All but the contraction keep lines straight; their `lines` gives a ray as origin + t direction in grid coordinates, and
`turned` its viewing direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from .rays import Rays

CONTRACTION_KNOTS = 64
FAR = 1.002  # of a path's parameter at infinity: the last knot, at 1, is 1000 radii away


@dataclass(frozen=True)
class Box:
    """The world as it is."""

    def to_grid(self, positions: Tensor) -> Tensor:
        """Grid coordinates of world positions [.., 3]."""
        return positions

    def to_world(self, positions: Tensor) -> Tensor:
        """World positions of grid coordinates [.., 3]."""
        return positions

    def paths(self, rays: Rays, minimum: Tensor, maximum: Tensor) -> Tensor:
        """Knots of each ray within the grid from corner `minimum` to `maximum` [3], [R, K, 3] grid coordinates; they
        coincide where it misses the grid."""
        return clipped_paths(*self.lines(rays), minimum, maximum)

    def lines(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Origins and directions [R, 3] of the rays, t being the world's distance from the camera."""
        return rays.origins, rays.viewdirs

    def turned(self, viewdirs: Tensor) -> Tensor:
        """Unit viewing directions [n, 3] of the world in the axes of the grid."""
        return viewdirs


@dataclass(frozen=True)
class Similarity:
    """world_to_grid: [4, 4], a rotation times a uniform scale, and a shift."""

    world_to_grid: Tensor

    def to_grid(self, positions: Tensor) -> Tensor:
        return positions @ self.world_to_grid[:3, :3].T + self.world_to_grid[:3, 3]

    def to_world(self, positions: Tensor) -> Tensor:
        return (positions - self.world_to_grid[:3, 3]) @ torch.linalg.inv(self.world_to_grid[:3, :3]).T

    def lines(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Origins and directions [R, 3] of the rays, t being the world's distance from the camera."""
        return self.to_grid(rays.origins), rays.viewdirs @ self.world_to_grid[:3, :3].T

    def turned(self, viewdirs: Tensor) -> Tensor:
        return torch.nn.functional.normalize(viewdirs @ self.world_to_grid[:3, :3].T, dim=-1)


@dataclass(frozen=True)
class Contraction:
    """center: [3] and radius: of the ball that keeps its shape, world units. near: distance from the camera, world
    units, before which nothing is looked for."""

    center: Tensor
    radius: float
    room: float
    near: float

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


@dataclass(frozen=True)
class Frustum:
    """world_to_camera: [4, 4] of the middle camera. focal: [2] focal length over half the picture's width and height.
    near: depth of the near plane, world units. depth_scale: half the grid's depth, in half picture widths."""

    world_to_camera: Tensor
    focal: Tensor
    near: float
    depth_scale: float

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
        return clipped_paths(*self.lines(rays), minimum, maximum, longest=1.0)

    def turned(self, viewdirs: Tensor) -> Tensor:
        return viewdirs @ self.world_to_camera[:3, :3].T

    def lines(self, rays: Rays) -> tuple[Tensor, Tensor]:
        """Origins and directions [R, 3] of the rays, from the near plane at t = 0 to infinity at t = 1."""
        origins = rays.origins @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        directions = self.turned(rays.viewdirs)
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


Space = Box | Similarity | Contraction | Frustum
KINDS = {"box": Box, "similarity": Similarity, "contraction": Contraction, "frustum": Frustum}


SHAPES = {"world_to_grid": (4, 4), "world_to_camera": (4, 4), "center": (3,), "focal": (2,)}  # others are numbers


def space_to_json(space: Space) -> dict:
    """Plain values of a space; `space_from_json` gives it back."""
    values = {name: v.tolist() if isinstance(v, Tensor) else v for name, v in vars(space).items()}
    return {"kind": type(space).__name__.lower(), **values}


def space_from_json(content: dict, device: torch.device | str = "cpu") -> Space:
    """The space of these values, its tensors on a device. Raises ValueError, KeyError or TypeError where it is none."""
    values = {
        name: torch.tensor(v, device=device) if isinstance(v, list) else float(v)
        for name, v in content.items()
        if name != "kind"
    }
    for name, value in values.items():
        if isinstance(value, Tensor) != (name in SHAPES) or getattr(value, "shape", None) != SHAPES.get(name):
            raise ValueError(f"a space whose {name} is {content[name]!r:.100}")
    return KINDS[content["kind"]](**values)


def space_on(space: Space, device: torch.device | str) -> Space:
    """The same space with its tensors on a device: that of all that is mapped by it."""
    return replace(
        space, **{name: value.to(device) for name, value in vars(space).items() if isinstance(value, Tensor)}
    )


def clipped_paths(
    origins: Tensor, directions: Tensor, minimum: Tensor, maximum: Tensor, longest: float | None = None
) -> Tensor:
    """First and last point within a box of the lines origin + t direction, 0 <= t (<= longest), [R, 2, 3]."""
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
