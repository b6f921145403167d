"""Where cameras stand about what they show, which directions they leave out, and where more photos would help.

A direction is seen from the scene's middle, as azimuth about the cameras' common up and elevation. What the cameras go
round is all directions between their lowest and highest, left and right; where one gap between azimuths is wider than
`OPEN_GAP`, the capture is of one side, and the gap is not asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..camera import Camera

OPEN_GAP = 120.0  # degrees
ROUND, HIGH = 72, 12  # how many directions are looked at, around and upwards
TURNED = 0.2  # how much cameras must turn about a common up, of 1 / sqrt 2, for it to be told by their turning
FEWEST_POINTS = 30  # by which the scene's middle is told


@dataclass(frozen=True)
class Placement:
    """Cameras about the middle of what they show.

    Attributes:
        center: [3], world.
        up: [3], unit, world.
        radius: Median distance of the cameras from the center, world units.
        directions: [n, 3], unit, from the center to each camera.
        wanted: [k, 3], unit: directions that the capture goes round.
        is_open: Whether it is of one side alone.
    """

    center: np.ndarray
    up: np.ndarray
    radius: float
    directions: np.ndarray
    wanted: np.ndarray
    is_open: bool

    @property
    def empty(self) -> np.ndarray:
        """Degrees from each wanted direction to the nearest camera, [k]."""
        return nearest_angles(self.wanted, self.directions)

    @property
    def spacing(self) -> float:
        """Root mean square of `empty`: how far a new view is from the photos, degrees."""
        return float(np.sqrt((self.empty**2).mean()))

    @property
    def hole(self) -> tuple[float, np.ndarray]:
        """Width of the widest hole, degrees, and the direction of its middle, [3]."""
        return 2 * float(self.empty.max()), self.wanted[self.empty.argmax()]

    def beside_hole(self) -> list[int]:
        """Numbers of the two cameras nearest to the widest hole's middle."""
        return np.argsort(-(self.directions @ self.hole[1]))[:2].tolist()

    def more(self, count: int) -> np.ndarray:
        """Directions [count, 3] of more photos, each in the middle of what is then the widest hole."""
        with_more = self
        for _ in range(count):
            with_more = with_more.and_at(with_more.hole[1])
        return with_more.directions[len(self.directions) :]

    def and_at(self, direction: np.ndarray) -> Placement:
        """The same with one more camera."""
        return replace(self, directions=np.concatenate([self.directions, direction[None]]))

    def angles(self, directions: np.ndarray) -> np.ndarray:
        """Azimuth in (-180, 180] and elevation of directions [m, 3], degrees, [m, 2]."""
        right, forward = _axes(self.up)
        azimuth = np.arctan2(directions @ forward, directions @ right)
        return np.degrees(np.stack([azimuth, np.arcsin((directions @ self.up).clip(-1, 1))], -1))


def place(cameras: Sequence[Camera], points: np.ndarray) -> Placement:
    """Where cameras stand about these points of the scene, [m, 3]; about where they look where these are few."""
    positions = np.stack([camera.position for camera in cameras])
    axes = -np.stack([camera.camera_to_world[:3, 2] for camera in cameras])
    center = np.median(points, axis=0) if len(points) >= FEWEST_POINTS else looked_at(positions, axes)
    up = common_up(np.stack([camera.camera_to_world[:3, :3] for camera in cameras]))
    away = positions - center
    distances = np.linalg.norm(away, axis=1)
    directions = away / np.maximum(distances, 1e-9)[:, None]
    bare = Placement(center, up, float(np.median(distances)), directions, directions, False)
    wanted, is_open = _gone_round(bare)
    return replace(bare, wanted=wanted, is_open=is_open)


def common_up(rotations: np.ndarray) -> np.ndarray:
    """The direction that is up for all cameras, [3], unit: at right angles to what is right of each, where they turn.

    Args:
        rotations: [n, 3, 3], camera to world.
    """
    above = rotations[:, :, 1].mean(0)
    _, sizes, across = np.linalg.svd(rotations[:, :, 0], full_matrices=True)
    turns = len(rotations) > 2 and sizes[1] > TURNED * np.sqrt(len(rotations))
    up = across[2] * np.sign(across[2] @ above) if turns else above
    length = np.linalg.norm(up)
    return up / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def looked_at(positions: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The point nearest to all optical axes, [3]; before the cameras' middle where they are parallel.

    Args:
        positions: [n, 3].
        axes: [n, 3], unit.
    """
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    spread = np.linalg.norm(positions - positions.mean(0), axis=1).mean()
    ahead = positions.mean(0) + 2 * spread * axes.mean(0)
    weak = 1e-3 * len(positions)
    total = across.sum(0) + weak * np.eye(3)
    return np.linalg.solve(total, (across @ positions[:, :, None]).sum(0)[:, 0] + weak * ahead)


def nearest_angles(directions: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Degrees from each direction [k, 3] to the nearest of others [n, 3], [k]."""
    return np.degrees(np.arccos((directions @ others.T).max(1).clip(-1, 1)))


def _gone_round(bare: Placement) -> tuple[np.ndarray, bool]:
    """The directions [k, 3] that a capture goes round, and whether it is of one side."""
    azimuth, elevation = bare.angles(bare.directions).T
    order = np.sort(azimuth)
    gaps = np.diff(np.append(order, order[0] + 360))
    widest = int(gaps.argmax())
    is_open = bool(gaps[widest] > OPEN_GAP)
    start = order[(widest + 1) % len(order)] if is_open else 0.0
    width = 360 - gaps[widest] if is_open else 360.0
    low, high = np.sin(np.radians([elevation.min(), elevation.max()]))
    turned = np.radians(start + width * (np.arange(ROUND) + 0.5) / ROUND)
    risen = np.arcsin(low + (high - low) * (np.arange(HIGH) + 0.5) / HIGH)  # equal areas
    right, forward = _axes(bare.up)
    flat = np.cos(turned)[:, None] * right + np.sin(turned)[:, None] * forward
    directions = np.cos(risen)[:, None, None] * flat + np.sin(risen)[:, None, None] * bare.up
    return directions.reshape(-1, 3), is_open


def _axes(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two directions at right angles to up and to each other, [3] each, right-handed with it."""
    start = np.eye(3)[np.abs(up).argmin()]
    right = start - up * (start @ up)
    right /= np.linalg.norm(right)
    return right, np.cross(up, right)


def seen_by_few(cameras: Sequence[Camera], center: np.ndarray, few: int = 2) -> float:
    """Share of what photos show that no more than a few of them show, in [0, 1], were all of it as far away as the middle.

    Args:
        cameras: Pinholes.
        center: [3], world.
        few: How many are few.
    """
    places = (np.stack(np.meshgrid(np.arange(8), np.arange(8)), -1).reshape(-1, 2) + 0.5) / 8
    counts = []
    for camera in cameras:
        depth = max(float(camera.project(center[None])[1][0]), 1e-9)
        start, along = camera.rays(places * (camera.width, camera.height))
        points = start + depth * along
        counts.append(sum(_shows(other, points) for other in cameras))
    return float((np.concatenate(counts) <= few).mean())


def _shows(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Whether points [m, 3] lie in a camera's picture, [m] of 0 and 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels, depth = camera.project(points)
        inside = ((pixels >= 0) & (pixels <= (camera.width, camera.height))).all(1)
    return (inside & (depth > 0)).astype(np.int64)
