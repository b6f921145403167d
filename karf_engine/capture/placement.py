"""Placement of the cameras around the scene, and the directions without photos.

Directions from the scene's center have an azimuth about the cameras' common up axis and an elevation. A capture should
cover all directions between its extreme elevations and azimuths; if a gap between azimuths is wider than `OPEN_GAP`, the
capture is of one side, and the gap is not to be covered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .camera import Camera

OPEN_GAP = 120.0  # degrees
ROUND, HIGH = 72, 12  # sampled azimuths and elevations
LEAST_SPREAD = 0.2  # of the cameras' right axes (1 / sqrt 2 for a full circle), to derive the up axis from them
FEWEST_POINTS = 30  # needed to derive the center from points
FEW = 2  # photos
GRID = 8  # sampled positions along each side of a photo


@dataclass(frozen=True)
class Placement:
    """Cameras around the scene's center."""

    center: np.ndarray  # [3], world
    up: np.ndarray  # common up axis, [3], unit, world
    radius: float  # median distance of the cameras from the center, world units
    directions: np.ndarray  # unit vectors from the center to the cameras, [n, 3]
    wanted: np.ndarray  # unit vectors to be covered, [k, 3]
    is_open: bool  # the capture is of one side

    @property
    def nearest_angles(self) -> np.ndarray:
        """Angles from the wanted directions to their nearest cameras, degrees, [k]."""
        return np.degrees(np.arccos((self.wanted @ self.directions.T).max(1).clip(-1, 1)))

    @property
    def spacing(self) -> float:
        """Root mean square of `nearest_angles`, degrees."""
        return float(np.sqrt((self.nearest_angles**2).mean()))

    @property
    def hole(self) -> tuple[float, np.ndarray]:
        """Width of the widest hole in degrees, and the direction of its center, [3]."""
        return 2 * float(self.nearest_angles.max()), self.wanted[self.nearest_angles.argmax()]

    def beside_hole(self) -> list[int]:
        """Return the indices of the two cameras nearest to the center of the widest hole."""
        return np.argsort(-(self.directions @ self.hole[1]))[:2].tolist()

    def extended(self, count: int) -> Placement:
        """Return the placement with more cameras, each at the center of the then widest hole."""
        extended = self
        for _ in range(count):
            extended = replace(extended, directions=np.concatenate([extended.directions, extended.hole[1][None]]))
        return extended

    def angles(self, directions: np.ndarray) -> np.ndarray:
        """Return azimuth in (-180, 180] and elevation of directions [m, 3], degrees, [m, 2]."""
        right, forward = _axes(self.up)
        azimuth = np.arctan2(directions @ forward, directions @ right)
        return np.degrees(np.stack([azimuth, np.arcsin((directions @ self.up).clip(-1, 1))], -1))


def measure_placement(cameras: Sequence[Camera], points: np.ndarray) -> Placement:
    """Return the placement of cameras around points [m, 3] of the scene, or around their focus if there are few."""
    positions = np.stack([camera.position for camera in cameras])
    axes = -np.stack([camera.camera_to_world[:3, 2] for camera in cameras])
    center = np.median(points, axis=0) if len(points) >= FEWEST_POINTS else _focus_point(positions, axes)
    up = _common_up(np.stack([camera.camera_to_world[:3, :3] for camera in cameras]))
    offsets = positions - center
    distances = np.linalg.norm(offsets, axis=1)
    directions = offsets / np.maximum(distances, 1e-9)[:, None]
    incomplete = Placement(center, up, float(np.median(distances)), directions, directions, False)
    wanted, is_open = _wanted_directions(incomplete)
    return replace(incomplete, wanted=wanted, is_open=is_open)


def _common_up(rotations: np.ndarray) -> np.ndarray:
    """Return the common up axis [3] of cameras [n, 3, 3]: orthogonal to their right axes, else their mean up."""
    mean_up = rotations[:, :, 1].mean(0)
    _, sizes, axes = np.linalg.svd(rotations[:, :, 0], full_matrices=True)
    is_spread = len(rotations) > 2 and sizes[1] > LEAST_SPREAD * np.sqrt(len(rotations))
    up = axes[2] * np.sign(axes[2] @ mean_up) if is_spread else mean_up
    length = np.linalg.norm(up)
    return up / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def _focus_point(positions: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return the point [3] nearest to all optical axes; in front of the mean camera if they are parallel."""
    projections = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    spread = np.linalg.norm(positions - positions.mean(0), axis=1).mean()
    ahead = positions.mean(0) + 2 * spread * axes.mean(0)
    weight = 1e-3 * len(positions)
    total = projections.sum(0) + weight * np.eye(3)
    return np.linalg.solve(total, (projections @ positions[:, :, None]).sum(0)[:, 0] + weight * ahead)


def _wanted_directions(bare: Placement) -> tuple[np.ndarray, bool]:
    """Return the directions [k, 3] that a capture should cover, and whether it is of one side."""
    azimuth, elevation = bare.angles(bare.directions).T
    order = np.sort(azimuth)
    gaps = np.diff(np.append(order, order[0] + 360))
    widest = int(gaps.argmax())
    is_open = bool(gaps[widest] > OPEN_GAP)
    start = order[(widest + 1) % len(order)] if is_open else 0.0
    width = 360 - gaps[widest] if is_open else 360.0
    low, high = np.sin(np.radians([elevation.min(), elevation.max()]))
    azimuths = np.radians(start + width * (np.arange(ROUND) + 0.5) / ROUND)
    elevations = np.arcsin(low + (high - low) * (np.arange(HIGH) + 0.5) / HIGH)  # equal areas
    right, forward = _axes(bare.up)
    flat = np.cos(azimuths)[:, None] * right + np.sin(azimuths)[:, None] * forward
    directions = np.cos(elevations)[:, None, None] * flat + np.sin(elevations)[:, None, None] * bare.up
    return directions.reshape(-1, 3), is_open


def _axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two axes [3] that form a right-handed orthonormal basis with `up`."""
    start = np.eye(3)[np.abs(up).argmin()]
    right = start - up * (start @ up)
    right /= np.linalg.norm(right)
    return right, np.cross(up, right)


def seen_by_few(cameras: Sequence[Camera], center: np.ndarray) -> float:
    """Estimate the share of the visible scene in at most `FEW` photos, assuming the depth of the center everywhere."""
    grid = (np.stack(np.meshgrid(np.arange(GRID), np.arange(GRID)), -1).reshape(-1, 2) + 0.5) / GRID
    counts = []
    for camera in cameras:
        depth = max(float(camera.project(center[None])[1][0]), 1e-9)
        origins, directions = camera.rays(grid * (camera.width, camera.height))
        points = origins + depth * directions
        counts.append(np.sum([_is_visible(other, points) for other in cameras], axis=0))
    return float((np.concatenate(counts) <= FEW).mean())


def _is_visible(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Test whether points [m, 3] project into a camera's image, [m] of 0 and 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels, depth = camera.project(points)
        inside = ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(1)
    return (inside & (depth > 0)).astype(np.int64)
