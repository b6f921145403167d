"""Cameras for Gaussians without photos: on a dome around the scene, or inside it if the dome is obstructed.

Gaussians grow with their distance from the photos' cameras. If sizes and distances agree, they determine the distance
of the cameras; otherwise the cameras frame the whole scene. Candidates are rated in thumbnails: those inside of objects
or with an almost empty picture are rejected, and the dome shrinks if most are. Of the others, those that show the most
surfaces are kept, since Gaussians seen from unphotographed directions are a haze.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from .gaussians import Gaussians
from .kernels.arrays import LOG_SCALE, LOGIT, ROTATION
from .rasterizer import rasterize
from .visibility import reliable_depths

SOLID = 0.3  # least opacity
SAMPLE = 20_000  # Gaussians that locate the scene
MIN_EXTENT = 1e-6  # of the largest coordinate: rounding of single precision
NEIGHBOR = 8  # whose distance measures the spacing
NEAR_MIDDLE = 4.0  # median distances from the middle to the background
UNEXPLAINED = 0.55  # largest fraction of the variance of log sizes that distances may leave unexplained
SIZE_DEVIATION = 0.3  # of log sizes; larger errors are outliers
ANGLE = np.radians(45)  # field of view
STEP_BACK = 1.3  # factor of the distance from sizes, to show the surroundings
FRAMING = 1.15  # half-width of the picture / radius of the scene
ELEVATIONS = np.radians((10, 60))
SHRINKS = 0.8 ** np.arange(6)  # factors of the dome's radius
CANDIDATES = 4  # per camera
THUMBNAIL, MAX_THUMBNAIL_GAUSSIANS = 64, 100_000
BLOCKED, NEAR_FRACTION = 0.05, 0.3  # largest fraction of a picture nearer than this fraction of the dome's radius
COVERED = 0.2  # least fraction of a picture that shows something
LEAST_RATING = 0.5  # relative to the best candidates
FREE = 0.5  # least fraction of usable candidates of a dome
PANORAMA_OFFSET = 0.1  # of the dome's radius, from the middle
FLATTENED = 0.55  # least largest eigenvalue of the normals' second moments with a floor
COLMAP_UP, BLENDER_UP = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Target:
    """Region shown by cameras."""

    middle: np.ndarray  # [3], world
    up: np.ndarray  # [3], unit vector
    distance: float  # between cameras and middle, world units


def estimate_target(gaussians: Gaussians, up: np.ndarray | None = None) -> Target:
    """Estimate what the photos of Gaussians showed, and from how far. Raises DataError if nothing is solid.

    up: [3]; None for the normal of the largest flat areas, on the side of COLMAP's -y or Blender's z.
    """
    table = gaussians.table[gaussians.table[:, LOGIT] > np.log(SOLID / (1 - SOLID))]
    if len(table) <= NEIGHBOR:
        raise DataError("Of {count} Gaussians almost all are transparent.", "Give another file.", count=len(gaussians))
    table = table[np.random.default_rng(0).permutation(len(table))[:SAMPLE]].astype(np.float64)
    table = table[_is_near(table[:, :3])]
    if np.ptp(table[:, :3], axis=0).max() <= MIN_EXTENT * np.abs(table[:, :3]).max():
        raise DataError("Of {count} Gaussians almost all lie in one place.", "Give another file.", count=len(gaussians))
    middle, distance = _by_sizes(table) or _by_extent(table[:, :3])
    return Target(middle, _up(table) if up is None else up / np.linalg.norm(up), distance)


def _is_near(centers: np.ndarray) -> np.ndarray:
    """Return False for centers [n, 3] of the distant background, [n] bool."""
    away = np.linalg.norm(centers - np.median(centers, 0), axis=1)
    return away <= NEAR_MIDDLE * np.median(away)


def _by_sizes(table: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Estimate middle and camera distance from the growth of sizes with distance; None if it explains too little.

    A point at r from the middle is at about sqrt(r^2 + distance^2) from cameras around it.
    """
    sizes = np.sort(table[:, LOG_SCALE : LOG_SCALE + 3], 1)[:, 1:].mean(1)
    start = np.median(table[:, :3], 0)
    unit = np.median(np.linalg.norm(table[:, :3] - start, axis=1)) + 1e-12
    points = (table[:, :3] - start) / unit

    def errors(guess: np.ndarray) -> np.ndarray:
        return sizes - 0.5 * np.log(((points - guess[:3]) ** 2).sum(1) + np.exp(2 * guess[3])) - guess[4]

    fits = [
        least_squares(errors, [0, 0, 0, log_distance, np.median(sizes)], loss="soft_l1", f_scale=SIZE_DEVIATION)
        for log_distance in (0.0, -1.0)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    if errors(best.x).var() > UNEXPLAINED * sizes.var() or sizes.std() < SIZE_DEVIATION:
        return None
    return start + unit * best.x[:3], float(STEP_BACK * unit * np.exp(best.x[3]))


def _by_extent(centers: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the middle of the densest region, and the distance that frames it."""
    spacing = build_kd_tree(centers).query(centers, NEIGHBOR + 1)[0][:, -1]
    dense = centers[spacing <= np.median(spacing)]
    dense = dense[_is_near(dense)]
    middle = np.percentile(dense, [2, 98], axis=0).mean(0)
    radius = np.percentile(np.linalg.norm(dense - middle, axis=1), 90)
    return middle, float(FRAMING * radius / np.tan(ANGLE / 2))


def _up(table: np.ndarray) -> np.ndarray:
    """Return the normal of most of the surface area, [3]."""
    scales = np.exp(table[:, LOG_SCALE : LOG_SCALE + 3])
    thinnest = scales.argmin(1)
    rotations = Rotation.from_quat(table[:, ROTATION:LOGIT], scalar_first=True).as_matrix()
    normals = np.take_along_axis(rotations, thinnest[:, None, None], 2)[..., 0]
    area = scales.prod(1) / scales.min(1)
    weights = np.minimum(area, 10 * np.median(area))[:, None]
    moments, axes = np.linalg.eigh((weights * normals).T @ normals / weights.sum())
    if moments[-1] < FLATTENED:
        return COLMAP_UP
    axis = axes[:, -1]
    usual = BLENDER_UP if abs(axis[2]) > abs(axis[1]) else COLMAP_UP
    return axis if axis @ usual >= 0 else -axis


def cameras_around(
    gaussians: Gaussians, target: Target, count: int, size: int, step: Callable[[], None] = lambda: None
) -> list[Camera]:
    """Return cameras that face the target from all sides, or outward from its middle if it surrounds them.

    count: their largest number; size: width and height of their pictures; step: called after each candidate, may raise Cancelled.
    """
    thinned = _thinned(gaussians)
    for distance in target.distance * SHRINKS:
        candidates = _dome(target, distance, CANDIDATES * count)
        ratings = np.array([_rating(thinned, camera, distance, step) for camera in candidates])
        if (ratings >= 0).mean() >= FREE:
            good = np.flatnonzero(ratings >= max(0, LEAST_RATING * np.quantile(ratings, 0.9)))
            even = np.unique(np.linspace(0, len(good) - 1, min(len(good), count)).round().astype(int))
            return [candidates[good[number]].scaled(size, size) for number in even]
    return [camera.scaled(size, size) for camera in _panorama(target, count)]


def _thinned(gaussians: Gaussians) -> Gaussians:
    """Return a subset of at most MAX_THUMBNAIL_GAUSSIANS, scaled up to cover the same area."""
    if len(gaussians) <= MAX_THUMBNAIL_GAUSSIANS:
        return gaussians
    table = gaussians.table[np.random.default_rng(0).choice(len(gaussians), MAX_THUMBNAIL_GAUSSIANS, replace=False)]
    table[:, LOG_SCALE : LOG_SCALE + 3] += 0.5 * np.log(len(gaussians) / MAX_THUMBNAIL_GAUSSIANS)
    return replace(gaussians, table=table, n_background=0)


def _dome(target: Target, distance: float, count: int) -> list[Camera]:
    """Return cameras on a spiral over the target, from low to high."""
    low, high = np.sin(ELEVATIONS)
    number = np.arange(count) + 0.5
    height, azimuth = low + (high - low) * number / count, np.pi * (1 + 5**0.5) * number
    directions = _directions(azimuth, height, target.up)
    return [_camera(target.middle + distance * each, -each, target.up) for each in directions]


def _panorama(target: Target, count: int) -> list[Camera]:
    """Return cameras near the middle that face outward, level, up and down in turn."""
    number = np.arange(count)
    azimuth, height = 2 * np.pi * number / count, np.sin(np.radians(20)) * np.array([0, 1, -1])[number % 3]
    directions = _directions(azimuth, height, target.up)
    return [_camera(target.middle - PANORAMA_OFFSET * target.distance * each, each, target.up) for each in directions]


def _directions(azimuth: np.ndarray, height: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return unit directions [n, 3] of azimuths [n] about the up axis and sines of elevations [n]."""
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    level = np.sqrt(1 - height**2)
    axes = np.stack([right, np.cross(up, right), up])
    return np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, height], 1) @ axes


def _camera(position: np.ndarray, direction: np.ndarray, up: np.ndarray) -> Camera:
    right = np.cross(direction, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(right, direction), -direction, position], 1)
    focal = THUMBNAIL / 2 / np.tan(ANGLE / 2)
    return Camera(THUMBNAIL, THUMBNAIL, focal, focal, THUMBNAIL / 2, THUMBNAIL / 2, pose)


def _rating(gaussians: Gaussians, camera: Camera, distance: float, step: Callable[[], None]) -> float:
    """Return the fraction of a picture with reliable depths; -1 if it is almost empty or obstructed."""
    view = rasterize(replace(gaussians, near=1e-3 * distance), camera)
    step()
    covered = 1 - view.image[..., 3]
    close = view.blended((view.depths < NEAR_FRACTION * distance).astype(np.float32)[:, None])[0]
    if (close > 0.5).mean() > BLOCKED or (covered > 0.5).mean() < COVERED:
        return -1.0
    return float((reliable_depths(view) > 0).mean())
