"""Cameras for Gaussians without photos: on a dome round what photos have looked at, or, where that is full, amid it.

What was photographed from near has finer Gaussians than what was far away. Where sizes tell so of distances, they tell
where the photographers stood; of a scene that lies together, cameras frame the whole. Candidates are looked through in
small pictures: one that stands amid something or sees little is left out, and where most are, the dome shrinks. Of the
others those stay that see surfaces: from where no photo was taken, Gaussians are a haze.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..compute.neighbors import tree_of
from ..errors import DataError
from .depths import sure_depths
from .gaussians import Gaussians
from .kernels.arrays import LOG_SCALE, LOGIT, ROTATION
from .rasterizer import splatted

SOLID = 0.3  # opacity
SAMPLE = 20_000  # Gaussians that say where the scene lies
ONE_PLACE = 1e-6  # of the largest coordinate: what single precision cannot tell apart
NEIGHBOR = 8  # to whose distance a Gaussian's surroundings are measured
NEAR_MIDDLE = 4.0  # median distances from the middle; what is farther is background
UNEXPLAINED = 0.55  # of the variance of sizes that distances leave unexplained, up to which they are believed
USUAL_ERROR = 0.3  # of a size's logarithm; larger ones count less
ANGLE = np.radians(45)  # field of view
STEP_BACK = 1.3  # of the distance that sizes tell: more is seen of what stands around
FRAMING = 1.15  # picture's half width by that of what is looked at
ELEVATIONS = np.radians((10, 60))
SHRINKS = 0.8 ** np.arange(6)  # of the dome, where candidates stand amid something
CANDIDATES = 4  # a wanted camera
THUMBNAIL, FEW = 64, 100_000  # pixels; Gaussians that small pictures are made of
BLOCKED, NEAR_SHARE = 0.05, 0.3  # share of a picture nearer than this share of the distance to the middle
COVERED = 0.2  # share of a picture that must show something
SURE = 0.5  # of the share that shows surfaces in the best views: less is not taken
FREE = 0.5  # share of the candidates with which a dome is taken
BESIDE = 0.1  # of the distance that cameras stand beside the middle where they look around from there
FLATTENED = 0.55  # of directions' second moments that the strongest has where a floor tells what is up
COLMAP_UP, BLENDER_UP = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])  # COLMAP's: as the first photo was held


@dataclass(frozen=True)
class Target:
    """What cameras look at.

    Attributes:
        middle: [3], world.
        up: [3], of unit length.
        distance: Of the cameras from the middle, world units.
    """

    middle: np.ndarray
    up: np.ndarray
    distance: float


def target_of(gaussians: Gaussians, up: np.ndarray | None = None) -> Target:
    """What the photos of Gaussians have looked at.

    Args:
        gaussians: As read.
        up: [3], or None: across the largest flat parts, to the side of COLMAP's -y or Blender's z.

    Raises:
        DataError: Nothing is solid, or all of it lies in one place.
    """
    table = gaussians.table[gaussians.table[:, LOGIT] > np.log(SOLID / (1 - SOLID))]
    if len(table) <= NEIGHBOR:
        raise DataError("Of {count} Gaussians almost all are transparent.", "Give another file.", count=len(gaussians))
    table = table[np.random.default_rng(0).permutation(len(table))[:SAMPLE]].astype(np.float64)
    table = table[_is_near(table[:, :3])]
    if np.ptp(table[:, :3], axis=0).max() <= ONE_PLACE * np.abs(table[:, :3]).max():
        raise DataError("Of {count} Gaussians almost all lie in one place.", "Give another file.", count=len(gaussians))
    middle, distance = _by_sizes(table) or _by_extent(table[:, :3])
    return Target(middle, _up(table) if up is None else up / np.linalg.norm(up), distance)


def _is_near(centers: np.ndarray) -> np.ndarray:
    """Whether centers [n, 3] are of the scene, and not of what is far behind it, [n]."""
    away = np.linalg.norm(centers - np.median(centers, 0), axis=1)
    return away <= NEAR_MIDDLE * np.median(away)


def _by_sizes(table: np.ndarray) -> tuple[np.ndarray, float] | None:
    """The middle, and how far from it photos were taken, such that sizes grow with the distance from the cameras.

    From cameras all round, `distance` away from the middle, something r away from it is at about the root of r^2 and
    distance^2. None where that explains little.
    """
    sizes = np.sort(table[:, LOG_SCALE : LOG_SCALE + 3], 1)[:, 1:].mean(1)
    start = np.median(table[:, :3], 0)
    unit = np.median(np.linalg.norm(table[:, :3] - start, axis=1)) + 1e-12
    places = (table[:, :3] - start) / unit

    def errors(guess: np.ndarray) -> np.ndarray:
        return sizes - 0.5 * np.log(((places - guess[:3]) ** 2).sum(1) + np.exp(2 * guess[3])) - guess[4]

    fits = [
        least_squares(errors, [0, 0, 0, log_distance, np.median(sizes)], loss="soft_l1", f_scale=USUAL_ERROR)
        for log_distance in (0.0, -1.0)
    ]
    best = min(fits, key=lambda fit: fit.cost)
    if errors(best.x).var() > UNEXPLAINED * sizes.var() or sizes.std() < USUAL_ERROR:
        return None
    return start + unit * best.x[:3], float(STEP_BACK * unit * np.exp(best.x[3]))


def _by_extent(centers: np.ndarray) -> tuple[np.ndarray, float]:
    """The middle of where centers lie densest, and from how far a picture holds them."""
    spacing = tree_of(centers).query(centers, NEIGHBOR + 1)[0][:, -1]
    dense = centers[spacing <= np.median(spacing)]
    dense = dense[_is_near(dense)]
    middle = np.percentile(dense, [2, 98], axis=0).mean(0)
    radius = np.percentile(np.linalg.norm(dense - middle, axis=1), 90)
    return middle, float(FRAMING * radius / np.tan(ANGLE / 2))


def _up(table: np.ndarray) -> np.ndarray:
    """Across most of the surface, [3]."""
    scales = np.exp(table[:, LOG_SCALE : LOG_SCALE + 3])
    thinnest = scales.argmin(1)
    rotations = Rotation.from_quat(table[:, ROTATION:LOGIT], scalar_first=True).as_matrix()
    normals = np.take_along_axis(rotations, thinnest[:, None, None], 2)[..., 0]
    area = scales.prod(1) / scales.min(1)
    weights = np.minimum(area, 10 * np.median(area))[:, None]
    shares, axes = np.linalg.eigh((weights * normals).T @ normals / weights.sum())
    if shares[-1] < FLATTENED:  # walls are as flat as the floor
        return COLMAP_UP
    axis = axes[:, -1]
    usual = BLENDER_UP if abs(axis[2]) > abs(axis[1]) else COLMAP_UP
    return axis if axis @ usual >= 0 else -axis


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
    thinned = _thinned(gaussians)
    for distance in target.distance * SHRINKS:
        candidates = _dome(target, distance, CANDIDATES * count)
        sure = np.array([_sure_share(thinned, camera, distance, step) for camera in candidates])
        if (sure >= 0).mean() >= FREE:
            good = np.flatnonzero(sure >= max(0, SURE * np.quantile(sure, 0.9)))
            return [candidates[good[number]].scaled(size, size) for number in _evenly(len(good), count)]
    return [camera.scaled(size, size) for camera in _panorama(target, count)]


def _thinned(gaussians: Gaussians) -> Gaussians:
    """As many Gaussians as small pictures need, each as much wider as there are fewer."""
    if len(gaussians) <= FEW:
        return gaussians
    table = gaussians.table[np.random.default_rng(0).choice(len(gaussians), FEW, replace=False)]
    table[:, LOG_SCALE : LOG_SCALE + 3] += 0.5 * np.log(len(gaussians) / FEW)
    return replace(gaussians, table=table, n_behind=0)


def _dome(target: Target, distance: float, count: int) -> list[Camera]:
    """Cameras on an even spiral over the target, from low to high."""
    low, high = np.sin(ELEVATIONS)
    number = np.arange(count) + 0.5
    height, turn = low + (high - low) * number / count, np.pi * (1 + 5**0.5) * number
    directions = _directions(turn, height, target.up)
    return [_looking(target.middle + distance * each, -each, target.up) for each in directions]


def _panorama(target: Target, count: int) -> list[Camera]:
    """Cameras at the target's middle and a little beside it, which look around, somewhat up and down."""
    number = np.arange(count)
    turn, height = 2 * np.pi * number / count, np.sin(np.radians(20)) * np.array([0, 1, -1])[number % 3]
    directions = _directions(turn, height, target.up)
    return [_looking(target.middle - BESIDE * target.distance * each, each, target.up) for each in directions]


def _directions(turn: np.ndarray, height: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Unit directions [n, 3] that are turned around what is up by angles [n], and reach up by sines of elevations [n]."""
    right = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    right /= np.linalg.norm(right)
    level = np.sqrt(1 - height**2)
    return np.stack([np.cos(turn) * level, np.sin(turn) * level, height], 1) @ np.stack(
        [right, np.cross(up, right), up]
    )


def _looking(place: np.ndarray, direction: np.ndarray, up: np.ndarray) -> Camera:
    right = np.cross(direction, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(right, direction), -direction, place], 1)
    focal = THUMBNAIL / 2 / np.tan(ANGLE / 2)
    return Camera(THUMBNAIL, THUMBNAIL, focal, focal, THUMBNAIL / 2, THUMBNAIL / 2, pose)


def _sure_share(gaussians: Gaussians, camera: Camera, distance: float, step: Callable[[], None]) -> float:
    """The share of a camera's picture that shows one surface; -1 where the camera sees little, or something too close."""
    view = splatted(replace(gaussians, near=1e-3 * distance), camera)
    step()
    covered = 1 - view.image[..., 3]
    close = view.blended((view.depths < NEAR_SHARE * distance).astype(np.float32)[:, None])[0]
    if (close > 0.5).mean() > BLOCKED or (covered > 0.5).mean() < COVERED:
        return -1.0
    return float((sure_depths(view) > 0).mean())


def _evenly(total: int, count: int) -> np.ndarray:
    return np.unique(np.linspace(0, total - 1, min(total, count)).round().astype(int))
