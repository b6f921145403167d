"""Surface points of Gaussians: reliable depths of pixels, and sparse points observed by several cameras."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import SparsePoints
from .gaussians import Gaussians

if TYPE_CHECKING:
    from .rasterizer import RasterizedView  # needs numba

LONG_SIDE = 400  # pixels of the depth maps
POINTS = 20_000
OPAQUE = 0.95  # least opacity of a pixel with a reliable depth
NEAR_QUANTILE, AT_INFINITY = 0.1, 12.0  # quantile of near depths; multiple of it without parallax between views
DEPTH_DEVIATION = 0.02  # largest relative standard deviation of the depths blended in a pixel
DEPTH_ERROR = 0.01  # largest relative difference between the depth of a point and of a view that observes it


def sample_surface_points(
    gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None
) -> SparsePoints:
    """Sample about POINTS points on visible surfaces, with their observations, as structure from motion does.

    Lens distortion is ignored. step: called after each view; may raise Cancelled.
    """
    from .rasterizer import rasterize  # needs numba

    small = [camera.without_distortion().reduced(LONG_SIDE) for camera in cameras]
    random = np.random.default_rng(0)
    depth_maps, positions, colors = [], [], []
    for camera in small:
        view = rasterize(gaussians, camera)
        depths = reliable_depths(view)
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


def reliable_depths(view: RasterizedView) -> np.ndarray:
    """Return the depths of pixels that show a single surface, [H, W]; 0 for other pixels and beyond AT_INFINITY."""
    seen = view.is_seen
    if not seen.any():
        return np.zeros(view.image.shape[:2], np.float32)
    is_near = seen & (view.depths < AT_INFINITY * np.quantile(view.depths[seen], NEAR_QUANTILE))
    depths = np.where(is_near, view.depths, np.float32(0))
    opacity, mean, square = view.blended(np.stack([is_near, depths, depths**2], 1, dtype=np.float32))
    mean, square = (
        np.divide(each, opacity, out=np.zeros_like(each), where=opacity > OPAQUE) for each in (mean, square)
    )
    return np.where(square - mean**2 <= (DEPTH_DEVIATION * mean) ** 2, mean, 0)


def _observations(
    world: np.ndarray, cameras: Sequence[Camera], small: Sequence[Camera], depth_maps: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the view, point and pixel of each observation."""
    views, points, places = [], [], []
    for number, (camera, lower, depths) in enumerate(zip(cameras, small, depth_maps, strict=True)):
        pixels, depth = lower.project(world)
        with np.errstate(invalid="ignore"):
            cells = np.floor(pixels)
            inside = (depth > 0) & ((cells >= 0) & (cells < (lower.width, lower.height))).all(1)
        candidates = np.flatnonzero(inside)
        columns, rows = cells[candidates].astype(int).T
        seen = depths[rows, columns]
        observed = candidates[np.abs(depth[candidates] - seen) <= DEPTH_ERROR * seen]
        views.append(np.full(len(observed), number, np.int32))
        points.append(observed.astype(np.int32))
        scale = camera.width / lower.width, camera.height / lower.height
        places.append((pixels[observed] * scale).astype(np.float32))
    return np.concatenate(views), np.concatenate(points), np.concatenate(places)
