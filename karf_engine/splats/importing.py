"""Gaussians of another program: as the scene is shown, and as sparse points that tell a field where its surface is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import CapturedSplats, SparsePoints
from .formats.registry import read_splats
from .gaussians import Gaussians
from .kernels.arrays import ANTIALIASED_FILTER, PLAIN_FILTER
from .start import nearest_shown

BLACK = (0.0, 0.0, 0.0)  # what most programs show behind all Gaussians
ANY_DEPTH = 1e-6
LONG_SIDE = 400  # pixels of the pictures in which depths are looked at
POINTS = 20_000
OPAQUE = 0.95  # opacity of a pixel whose depth is believed
NEAR_SHARE, AT_INFINITY = 0.1, 12.0  # this share of a view is near; so many times as far nothing moves between views
SHARP = 0.02  # deviation of the depths that a pixel blends, by their mean
AGREEING = 0.01  # difference of a point's depth and a view's, by the latter


def captured_gaussians(splats: CapturedSplats, cameras: Sequence[Camera]) -> Gaussians:
    """Gaussians as their file has them, over black.

    Args:
        splats: Of a capture.
        cameras: The capture's.

    Raises:
        DataError: The file is missing or damaged.
        MissingDependency: The package that reads such files is missing.
    """
    return gaussians_before(read_splats(splats.path).table, splats.is_antialiased, cameras)


def gaussians_before(table: np.ndarray, is_antialiased: bool, cameras: Sequence[Camera]) -> Gaussians:
    """A table of another program as cameras show it, over black.

    Args:
        table: [n, 11 + 3 K], see `gaussians.Gaussians`.
        is_antialiased: See `CapturedSplats`.
        cameras: They say what is too near to be shown; without any, all is shown.
    """
    near = nearest_shown(table[:, :3], np.stack([camera.position for camera in cameras])) if cameras else ANY_DEPTH
    return Gaussians(table, 0, BLACK, near, ANTIALIASED_FILTER if is_antialiased else PLAIN_FILTER)


def points_seen(
    gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None
) -> SparsePoints:
    """Points on what cameras see of Gaussians, each with the cameras that see it, as structure from motion has them.

    Args:
        gaussians: The scene.
        cameras: V of them; their lens distortion is left out.
        step: Called after each view, V times; may raise Cancelled.

    Returns:
        About POINTS of them, fewer where little is opaque; pixels are of the cameras' pictures.
    """
    from .rasterizer import splatted  # needs numba

    small = [camera.without_distortion().reduced(LONG_SIDE) for camera in cameras]
    random = np.random.default_rng(0)
    depth_maps, positions, colors = [], [], []
    for camera in small:
        view = splatted(gaussians, camera)
        depths = _sure_depths(view)
        chosen = np.flatnonzero(depths)
        chosen = random.choice(chosen, min(len(chosen), -(-POINTS // len(small))), replace=False)
        origins, directions = camera.rays(camera.pixel_centers()[chosen])
        positions.append(origins + depths.ravel()[chosen, None] * directions)
        colors.append(view.picture().reshape(-1, 3)[chosen])
        depth_maps.append(depths)
        step()
    world = np.concatenate(positions)
    view_numbers, points, pixels = _observations(world, cameras, small, depth_maps)
    return SparsePoints(
        positions=world,
        colors=np.round(255 * np.concatenate(colors)).astype(np.uint8),
        errors=np.zeros(len(world), np.float32),
        view=view_numbers,
        point=points,
        pixels=pixels,
    )


def _sure_depths(view) -> np.ndarray:
    """Depths of the pixels that show one surface, [H, W]; 0 of others."""
    depths = view.depths[:, None]
    depths = np.where(np.diff(view.slots)[:, None] > 0, depths, 0)
    mean, square = view.blended(np.concatenate([depths, depths**2], 1))
    opacity = 1 - view.image[..., 3]
    is_opaque = opacity > OPAQUE
    if not is_opaque.any():
        return np.zeros_like(mean)
    mean, square = (np.divide(each, opacity, out=np.zeros_like(each), where=is_opaque) for each in (mean, square))
    farthest = AT_INFINITY * np.quantile(mean[is_opaque], NEAR_SHARE)
    is_sure = (square - mean**2 <= (SHARP * mean) ** 2) & (mean < farthest)
    return np.where(is_sure, mean, 0)


def _observations(
    world: np.ndarray, cameras: Sequence[Camera], small: Sequence[Camera], depth_maps: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The number of the view and of the point, and the pixel, of each observation."""
    views, points, places = [], [], []
    for number, (camera, lower, depths) in enumerate(zip(cameras, small, depth_maps, strict=True)):
        pixels, depth = lower.project(world)
        with np.errstate(invalid="ignore"):
            cells = np.floor(pixels)
            inside = (depth > 0) & ((cells >= 0) & (cells < (lower.width, lower.height))).all(1)
        rows = np.flatnonzero(inside)
        columns, lines = cells[rows].astype(int).T
        seen = depths[lines, columns]
        rows = rows[np.abs(depth[rows] - seen) <= AGREEING * seen]
        views.append(np.full(len(rows), number, np.int32))
        points.append(rows.astype(np.int32))
        places.append((pixels[rows] * (camera.width / lower.width, camera.height / lower.height)).astype(np.float32))
    return np.concatenate(views), np.concatenate(points), np.concatenate(places)
