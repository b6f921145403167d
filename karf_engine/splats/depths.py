"""Where Gaussians have surfaces: depths that one pixel is sure of, and sparse points that several cameras agree on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import SparsePoints
from .gaussians import Gaussians

if TYPE_CHECKING:
    from .rasterizer import SplattedView  # needs numba

LONG_SIDE = 400  # pixels of the pictures in which depths are looked at
POINTS = 20_000
OPAQUE = 0.95  # opacity of a pixel whose depth is believed
NEAR_SHARE, AT_INFINITY = 0.1, 12.0  # this share of Gaussians is near; so many times as far nothing moves between views
SHARP = 0.02  # deviation of the depths that a pixel blends, by their mean
AGREEING = 0.01  # difference of a point's depth and a view's, by the latter


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
        depths = sure_depths(view)
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


def sure_depths(view: SplattedView) -> np.ndarray:
    """Depths of the pixels that show one surface, [H, W]; 0 of others, and of what is so far that nothing moves."""
    seen = np.diff(view.slots) > 0
    if not seen.any():
        return np.zeros(view.image.shape[:2], np.float32)
    is_near = seen & (view.depths < AT_INFINITY * np.quantile(view.depths[seen], NEAR_SHARE))
    depths = np.where(is_near, view.depths, np.float32(0))
    opacity, mean, square = view.blended(np.stack([is_near, depths, depths**2], 1, dtype=np.float32))
    mean, square = (
        np.divide(each, opacity, out=np.zeros_like(each), where=opacity > OPAQUE) for each in (mean, square)
    )
    return np.where(square - mean**2 <= (SHARP * mean) ** 2, mean, 0)


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
