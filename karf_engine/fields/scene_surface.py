"""Points on the visible surface of a frozen scene, fused from the ray ends of all views.

Rays that end sharply, not spread over a silhouette, are averaged in cells whose size gives about the requested number
of points. As in stereo fusion, points that more views see through than end at are dropped (Schoenberger et al.,
"Pixelwise View Selection for Unstructured Multi-View Stereo").
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from .protocol import Field
from .scene import Scene

ENDS_PER_POINT = 8
PROBE = 2000  # pixels per view that measure the share of sharp rays
FEWEST_SHARP = 0.05  # smallest share of sharp rays that more rays make up for
SAMPLES = 3  # quantiles per ray: the middle one is its end, the others measure the spread
MIN_OPACITY = 0.9
MOST_SPREAD = 8.0  # voxels; silhouettes spread farther, shiny surfaces almost as far
NEIGHBORS = 12  # for smoothing normals
NEAREST = 4  # neighbors whose mean distance is the spacing
OUTLIER_DISTANCE = 3.0  # cells to the sixth neighbor; farther points are floaters


class NoSurface(DataError):
    """The scene is fog without a surface."""


@dataclass(frozen=True)
class SurfacePoints:
    """N points on a scene's surface."""

    positions: np.ndarray  # [N, 3] float32, grid coordinates of the scene's field
    world_positions: np.ndarray  # [N, 3] float32, world coordinates
    normals: np.ndarray  # [N, 3] float32, unit normals in the world, facing the cameras
    spacing: np.ndarray  # [N] float32, local distance between points, world units
    colors: np.ndarray  # [N, 3] float32 sRGB in [0, 1], mean over the views that see the point
    viewdirs: np.ndarray  # [N, 3] float32, mean unit viewing direction


def surface_points(
    scene: Scene, views: Sequence[View], count: int, step: Callable[[], None] = lambda: None
) -> SurfacePoints:
    """Compute about `count` points on the surface of a frozen scene that these views, spread around it, see.

    `step` is called after each view; it may raise Cancelled.

    Raises:
        NoSurface: No ray ends at a surface.
    """
    probes = [len(_trace_view(scene, _pinhole(view, PROBE)).ends.weights) for view in views[:: max(1, len(views) // 8)]]
    pixels = count * ENDS_PER_POINT / len(views) / max(float(np.mean(probes)) / PROBE, FEWEST_SHARP)
    traces = []
    for view in views:
        traces.append(_trace_view(scene, _pinhole(view, pixels)))
        step()
    ends = _Ends(*[np.concatenate([getattr(t.ends, item.name) for t in traces]) for item in fields(_Ends)])
    merged, kept = _fuse(scene.field, ends, traces, min(count, len(ends.weights) / 2))
    if kept.sum() <= 0.85 * count:  # compensate for dropped points
        merged, kept = _fuse(scene.field, ends, traces, min(1.3 * count, len(ends.weights) / 2))
    if not kept.any():
        raise NoSurface("The learned scene shows nothing solid.", "Learn it again, with other settings.")
    points = merged.part(kept)
    world = _to_world(scene.field, points.positions)
    distances, neighbors = build_kd_tree(world).query(world, min(NEIGHBORS, len(world)))
    spacing = distances[:, 1 : NEAREST + 1].mean(1).astype(np.float32)
    normals = _normals(scene.field, points, world, neighbors)
    return SurfacePoints(points.positions, world.astype(np.float32), normals, spacing, points.colors, points.viewdirs)


@dataclass(frozen=True)
class _Ends:
    """Ends of n rays."""

    positions: np.ndarray  # [n, 3] grid coordinates
    colors: np.ndarray  # [n, 3] sRGB
    viewdirs: np.ndarray  # [n, 3], unit directions
    weights: np.ndarray  # [n], sharpness of the end; low for silhouettes, whose colors are mixed

    def part(self, chosen: np.ndarray) -> _Ends:
        return _Ends(self.positions[chosen], self.colors[chosen], self.viewdirs[chosen], self.weights[chosen])


@dataclass(frozen=True)
class _ViewEnds:
    """One view: its pinhole, depth [H, W] in world units (0 if open), and the sharp ends of its rays."""

    camera: Camera
    depth: np.ndarray
    ends: _Ends


def _fuse(field: Field, ends: _Ends, traces: Sequence[_ViewEnds], count: float) -> tuple[_Ends, np.ndarray]:
    """Merge ends to about `count` points; return them and which are not floaters, [n] bool."""
    if not len(ends.weights):
        return ends, np.zeros(0, bool)
    merged, cell = _average_in_cells(ends, field.voxel, count)
    world = _to_world(field, merged.positions)
    distances, _ = build_kd_tree(merged.positions).query(merged.positions, [7])  # to the sixth neighbor
    is_isolated = distances[:, 0] > OUTLIER_DISTANCE * cell
    return merged, _is_seen(world, _voxel_sizes(field, merged.positions), traces) & ~is_isolated


def _pinhole(view: View, pixels: float) -> Camera:
    """Return a view's pinhole with about this many pixels."""
    camera = view.camera.without_distortion()
    factor = math.sqrt(pixels / (camera.width * camera.height))
    return camera.scaled(max(1, round(camera.width * factor)), max(1, round(camera.height * factor)))


def _trace_view(scene: Scene, camera: Camera) -> _ViewEnds:
    picture = scene.render(camera, SAMPLES)
    cache, field = picture.cache, scene.field
    assert cache is not None
    sharp = (cache.opacity > MIN_OPACITY) & (cache.spread < MOST_SPREAD * field.voxel)
    weights = torch.exp(-cache.spread / field.voxel) + 1e-4
    values = cache.positions[:, SAMPLES // 2], picture.color.view(-1, 3)[cache.index], cache.viewdirs, weights
    ends = _Ends(*[each[sharp].float().cpu().numpy() for each in values])
    depth = np.zeros(camera.width * camera.height)
    depth[cache.index.cpu().numpy()] = camera.project(_to_world(field, values[0].cpu().numpy()))[1]
    return _ViewEnds(camera, depth.reshape(camera.height, camera.width), ends)


def _average_in_cells(ends: _Ends, voxel: float, count: float) -> tuple[_Ends, float]:
    """Average the ends in about `count` cells; return the means and the cell size."""
    cell = voxel
    for _ in range(8):
        found = len(np.unique(_cell_numbers(ends.positions, cell)))
        if abs(found / count - 1) < 0.03:
            break
        cell *= (found / count) ** 0.5  # the number of cells on a surface is inverse to their squared size
    _, point = np.unique(_cell_numbers(ends.positions, cell), return_inverse=True)
    point = point.ravel()
    total = np.bincount(point, ends.weights)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(point, ends.weights * column) for column in values.T]
        return (np.stack(sums, 1) / total[:, None]).astype(np.float32)

    viewdirs = mean(ends.viewdirs)
    viewdirs /= np.maximum(np.linalg.norm(viewdirs, axis=1, keepdims=True), 1e-6)
    return _Ends(mean(ends.positions), mean(ends.colors), viewdirs, total / np.bincount(point)), cell


def _cell_numbers(positions: np.ndarray, cell: float) -> np.ndarray:
    """Return the cell number of each position, [n] int64."""
    cells = np.floor((positions - positions.min(0)) / cell).astype(np.int64)
    extent = cells.max(0) + 1
    return (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]


def _is_seen(world: np.ndarray, voxels: np.ndarray, traces: Sequence[_ViewEnds]) -> np.ndarray:
    """Return which points [n, 3] at least two views end at, and at least as many as see through them.

    `voxels` [n] is the local size of the field's voxels, world units.
    """
    ending, passing = np.zeros(len(world), np.int32), np.zeros(len(world), np.int32)
    for trace in traces:
        height, width = trace.depth.shape
        pixels, depth = trace.camera.project(world)
        column, row = np.floor(np.where(depth[:, None] > 0, pixels, -1)).clip(-1, max(height, width)).astype(int).T
        inside = np.flatnonzero((column >= 0) & (column < width) & (row >= 0) & (row < height))
        seen = trace.depth[row[inside], column[inside]]
        behind = np.where(seen > 0, seen, np.inf) - depth[inside]
        tolerance = voxels[inside] + 0.5 * depth[inside] / trace.camera.fx  # half a pixel of a slope
        ending[inside] += np.abs(behind) < tolerance
        passing[inside] += behind > tolerance
    return (ending >= min(2, len(traces))) & (ending >= passing)


def _voxel_sizes(field: Field, positions: np.ndarray) -> np.ndarray:
    """Return the voxel size at grid positions [n, 3], world units."""
    beside = np.repeat(positions[:, None], 3, 1) + field.voxel * np.eye(3, dtype=np.float32)
    steps = _to_world(field, beside) - _to_world(field, positions)[:, None]
    return np.linalg.norm(steps, axis=2).max(1)


def _to_world(field: Field, positions: np.ndarray) -> np.ndarray:
    return field.space.to_world(torch.from_numpy(positions).to(field.bounds.device)).cpu().numpy()


def _normals(field: Field, merged: _Ends, world: np.ndarray, neighbors: np.ndarray) -> np.ndarray:
    """Return unit normals [n, 3] in the world, facing the cameras, smoothed over neighbors [n, m]."""
    positions = torch.from_numpy(merged.positions).to(field.bounds.device)
    along = torch.cat([field.normals(some) for some in positions.split(1 << 17)]).cpu().numpy()
    normals = _normalize(_to_world(field, merged.positions + field.voxel * along) - world, -merged.viewdirs)
    faces_away = (normals * merged.viewdirs).sum(1, keepdims=True) > 0
    normals = np.where(faces_away, -normals, normals)
    agree = np.einsum("nmc,nc->nm", normals[neighbors], normals) > 0  # not across thin objects
    return _normalize(np.einsum("nmc,nm->nc", normals[neighbors], agree), normals).astype(np.float32)


def _normalize(vectors: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Normalize vectors [n, 3]; `otherwise` replaces zero vectors."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), otherwise)
