"""Cameras for Gaussians without photos: around what is solid, or, where that surrounds them, from its middle.

Where Gaussians lie densest photos have looked closest. Candidates on a dome round that place are looked through in small
pictures: one that stands amid something or sees little is left out, and where most are, the dome shrinks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..errors import DataError
from .gaussians import Gaussians
from .kernels.arrays import LOG_SCALE, LOGIT, ROTATION
from .rasterizer import splatted

SOLID = 0.3  # opacity
SAMPLE = 20_000  # Gaussians that say where they lie densest
NEIGHBOR = 8  # to whose distance a Gaussian's surroundings are measured
NEAR_MIDDLE = 4.0  # median distances from the middle; what is farther is background
ANGLE = np.radians(45)  # field of view
FRAMING = 1.15  # picture's half width by that of what is looked at
ELEVATIONS = np.radians((10, 60))
SHRINKS = 0.8 ** np.arange(6)  # of the dome, where candidates stand amid something
CANDIDATES = 3  # a wanted camera
THUMBNAIL = 48  # pixels
BLOCKED, NEAR_SHARE = 0.05, 0.3  # share of a picture nearer than this share of the distance to the middle
COVERED = 0.2  # share of a picture that must show something
FREE = 0.5  # share of the candidates with which a dome is taken
FLATTENED = 0.5  # of directions' second moments that the strongest has where a floor tells what is up


@dataclass(frozen=True)
class Target:
    """What cameras look at. middle, up: [3]; up of unit length. radius: half of its width, world units."""

    middle: np.ndarray
    up: np.ndarray
    radius: float


def target_of(gaussians: Gaussians, up: np.ndarray | None = None) -> Target:
    """The place where Gaussians lie densest.

    Args:
        gaussians: As read.
        up: [3], or None: across the largest flat parts, and there to the side where COLMAP's y or Blender's z says so.

    Raises:
        DataError: Nothing is solid.
    """
    table = gaussians.table[gaussians.table[:, LOGIT] > np.log(SOLID / (1 - SOLID))]
    if len(table) <= NEIGHBOR:
        raise DataError("Of {count} Gaussians hardly one is solid.", "Give another file.", count=len(gaussians))
    table = table[np.random.default_rng(0).permutation(len(table))[:SAMPLE]]
    centers = table[:, :3].astype(np.float64)
    spacing = cKDTree(centers).query(centers, NEIGHBOR + 1)[0][:, -1]
    dense = centers[spacing <= np.median(spacing)]
    for _ in range(2):
        distance = np.linalg.norm(dense - np.median(dense, 0), axis=1)
        dense = dense[distance <= NEAR_MIDDLE * np.median(distance)]
    middle = np.percentile(dense, [2, 98], axis=0).mean(0)
    radius = np.percentile(np.linalg.norm(dense - middle, axis=1), 90)
    near = table[np.linalg.norm(centers - middle, axis=1) <= 2 * radius]
    return Target(middle, _up(near) if up is None else up / np.linalg.norm(up), float(radius))


def _up(table: np.ndarray) -> np.ndarray:
    """Across most of the surface, [3]."""
    scales = np.exp(table[:, LOG_SCALE : LOG_SCALE + 3].astype(np.float64))
    thinnest = scales.argmin(1)
    rotations = Rotation.from_quat(table[:, ROTATION:LOGIT], scalar_first=True).as_matrix()
    normals = np.take_along_axis(rotations, thinnest[:, None, None], 2)[..., 0]
    area = scales.prod(1) / scales.min(1)
    weights = np.minimum(area, 10 * np.median(area))[:, None]
    shares, axes = np.linalg.eigh((weights * normals).T @ normals / weights.sum())
    axis = axes[:, -1] if shares[-1] > FLATTENED else np.array([0.0, -1.0, 0.0])
    return axis * (np.sign(axis[2]) if abs(axis[2]) > abs(axis[1]) else -np.sign(axis[1]))


def cameras_around(
    gaussians: Gaussians, target: Target, count: int, size: int, step: Callable[[], None] = lambda: None
) -> list[Camera]:
    """Cameras that look at the target from all sides, or around from its middle where it surrounds them.

    Args:
        gaussians: As read.
        target: Of them.
        count: How many.
        size: Width and height of their pictures.
        step: Called after each candidate; may raise Cancelled.
    """
    whole = FRAMING * target.radius / np.tan(ANGLE / 2)
    for distance in whole * SHRINKS:
        candidates = _dome(target, distance, CANDIDATES * count)
        is_free = np.array([_is_free(gaussians, camera, distance, step) for camera in candidates])
        if is_free.mean() >= FREE:
            free = [camera for camera, good in zip(candidates, is_free, strict=True) if good]
            return [free[number].scaled(size, size) for number in _evenly(len(free), count)]
    return [camera.scaled(size, size) for camera in _panorama(target, count)]


def _dome(target: Target, distance: float, count: int) -> list[Camera]:
    """Cameras on an even spiral over the target, from low to high."""
    low, high = np.sin(ELEVATIONS)
    number = np.arange(count) + 0.5
    height, turn = low + (high - low) * number / count, np.pi * (1 + 5**0.5) * number
    out = np.stack([np.cos(turn) * np.sqrt(1 - height**2), np.sin(turn) * np.sqrt(1 - height**2), height], 1)
    return [_looking(target.middle + distance * way, -way, target.up) for way in out @ _upright(target.up)]


def _panorama(target: Target, count: int) -> list[Camera]:
    """Cameras at the target's middle and a little beside it, which look around, somewhat up and down."""
    number = np.arange(count)
    turn, height = 2 * np.pi * number / count, np.sin(np.radians(20)) * np.array([0, 1, -1])[number % 3]
    out = np.stack([np.cos(turn) * np.sqrt(1 - height**2), np.sin(turn) * np.sqrt(1 - height**2), height], 1)
    places = target.middle - 0.2 * target.radius * out @ _upright(target.up)
    return [_looking(place, way, target.up) for place, way in zip(places, out @ _upright(target.up), strict=True)]


def _upright(up: np.ndarray) -> np.ndarray:
    """Two directions across and up, [3, 3] rows."""
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(up, right), up])


def _looking(place: np.ndarray, way: np.ndarray, up: np.ndarray) -> Camera:
    right = np.cross(way, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(right, way), -way, place], 1)
    focal = THUMBNAIL / 2 / np.tan(ANGLE / 2)
    return Camera(THUMBNAIL, THUMBNAIL, focal, focal, THUMBNAIL / 2, THUMBNAIL / 2, pose)


def _is_free(gaussians: Gaussians, camera: Camera, distance: float, step: Callable[[], None]) -> bool:
    """Whether a camera sees something, and next to nothing close before it."""
    view = splatted(replace(gaussians, near=1e-3 * distance), camera)
    step()
    covered = 1 - view.image[..., 3]
    close = view.blended((view.depths < NEAR_SHARE * distance).astype(np.float32)[:, None])[0]
    return bool((close > 0.5).mean() <= BLOCKED and (covered > 0.5).mean() >= COVERED)


def _evenly(total: int, count: int) -> np.ndarray:
    return np.unique(np.linspace(0, total - 1, min(total, count)).round().astype(int))
