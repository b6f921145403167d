"""Views of Gaussians: surface points with their observations, and the confidence in appearances.

A surface is known from the photos' directions and somewhat beyond. From elsewhere a Gaussian's color is unconstrained.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import SparsePoints
from .gaussians import Gaussians
from .rasterizer import Device, rasterize
from .view import RasterizedView

LONG_SIDE = 400  # pixels of the depth maps
POINTS = 20_000
OPAQUE = 0.95  # least opacity of a pixel with a reliable depth
NEAR_QUANTILE, AT_INFINITY = 0.1, 12.0  # quantile of near depths; multiple of it without parallax between views
DEPTH_DEVIATION = 0.02  # largest relative standard deviation of the depths blended in a pixel
DEPTH_ERROR = 0.01  # largest relative difference between the depth of a point and of a view that observes it
SIDE = 256  # pixels of the reduced photos
VISIBLE = 0.05  # pixels that a Gaussian must cover there, as the sum of its blending weights
ENOUGH = 2.0  # photos needed for full confidence
KNOWN, UNKNOWN = np.radians(10), np.radians(40)  # angles beyond the outermost photo of full and of no confidence


def sample_surface_points(
    gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None
) -> SparsePoints:
    """Sample about POINTS points on visible surfaces, with their observations, as structure from motion does.

    Lens distortion is ignored. step: called after each view; may raise Cancelled.
    """
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


def visibility_in_photos(
    gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None, device: Device = "cpu"
) -> np.ndarray:
    """Compute `Gaussians.visibility` for the photos' cameras. step: called after each; may raise Cancelled."""
    centers, shown = gaussians.table[:, :3], []
    for camera in cameras:
        small = camera.without_distortion().reduced(SIDE)
        shown.append(rasterize(gaussians, small, None, device).weights() >= VISIBLE)
        step()
    eyes = [camera.position for camera in cameras]
    middle = sum(is_shown[:, None] * _directions(centers, eye) for is_shown, eye in zip(shown, eyes, strict=True))
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-6)
    widest = np.zeros(len(centers), np.float32)
    for is_shown, eye in zip(shown, eyes, strict=True):
        widest = np.maximum(widest, np.where(is_shown, _angles(middle, _directions(centers, eye)), 0))
    return np.column_stack([middle, widest, np.sum(shown, axis=0)]).astype(np.float32)


def confidence_from(gaussians: Gaussians, eye: np.ndarray) -> np.ndarray:
    """Return the confidence in each Gaussian's appearance from a viewpoint [3], [n] float32 in [0, 1].

    1 if at least ENOUGH photos show it and the viewpoint is at most KNOWN beyond them, and for the background; 0 from
    UNKNOWN beyond them or if no photo shows it. gaussians: with `visibility`.
    """
    assert gaussians.visibility is not None
    middle, widest, count = np.split(gaussians.visibility, (3, 4), axis=1)
    beyond = _angles(middle, _directions(gaussians.table[:, :3], eye)) - widest[:, 0]
    known = np.clip((UNKNOWN - beyond) / (UNKNOWN - KNOWN), 0, 1) * np.minimum(count[:, 0] / ENOUGH, 1)
    known[gaussians.n_foreground :] = 1
    return (known * known * (3 - 2 * known)).astype(np.float32)  # smoothstep: no visible seam


def _directions(centers: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return unit vectors [n, 3] from centers to a viewpoint."""
    away = np.asarray(eye, np.float32) - centers
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def _angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return angles [n] between unit vectors [n, 3], radians."""
    return np.arccos(np.clip(np.einsum("nc,nc->n", one, other), -1, 1))
