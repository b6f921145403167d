"""Points on what the captured cameras see of a frozen scene: its surface, merged and checked.

Rays of all views end somewhere. Those that end at one place, and not spread over a silhouette, are merged in cells of a
size that gives about as many points as are wanted; points that more views look through than end at are dropped, as
depth maps are fused in stereo (Schoenberger et al., "Pixelwise View Selection for Unstructured Multi-View Stereo").
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import View
from ..compute.neighbors import tree_of
from ..errors import DataError
from .protocol import Field
from .scene import Scene

ENDS_PER_POINT = 8
PROBE = 2000  # pixels of each view on which the share of rays that end sharply is measured
FEWEST_SHARP = 0.05  # share of a probe's rays: with fewer sharp ones the scene is too blurred for more rays to help
SAMPLES = 3  # quantiles of each ray: the middle one is where it ends, the others measure how sharply
MIN_OPACITY = 0.9
MOST_SPREAD = 8.0  # voxels, of a ray's end: a silhouette's is longer, that of a shiny surface nearly so
NEIGHBORS = 12  # over which normals are smoothed
NEAREST = 4  # whose distance is that between points
OUTLIER_DISTANCE = 3.0  # cells to the sixth neighbor: such points float


class NothingSolid(DataError):
    """A scene has no surface: it is fog."""


@dataclass(frozen=True)
class SurfacePoints:
    """N points on a scene's surface.

    Attributes:
        positions: [N, 3] float32, grid coordinates of the scene's field.
        world: [N, 3] float32, the same in the capture's world.
        normals: [N, 3] float32, in the world's axes, on the side from which the points are seen, of unit length.
        spacing: [N] float32, how far apart points are there, world units.
        colors: [N, 3] float32 sRGB in [0, 1], the mean over the views that see the point.
        viewdirs: [N, 3] float32 of unit length, the mean direction in which they look.
    """

    positions: np.ndarray
    world: np.ndarray
    normals: np.ndarray
    spacing: np.ndarray
    colors: np.ndarray
    viewdirs: np.ndarray


def surface_points(
    scene: Scene, views: Sequence[View], count: int, step: Callable[[], None] = lambda: None
) -> SurfacePoints:
    """Points on what these views see of a scene.

    Args:
        scene: Frozen.
        views: Whose cameras look at it, spread round it.
        count: About how many points.
        step: Called after each view; may raise Cancelled.

    Raises:
        NothingSolid: No ray ends at a surface.
    """
    probes = [len(_look(scene, _camera_of(view, PROBE)).ends.weights) for view in views[:: max(1, len(views) // 8)]]
    pixels = count * ENDS_PER_POINT / len(views) / max(np.mean(probes) / PROBE, FEWEST_SHARP)
    looks = []
    for view in views:
        looks.append(_look(scene, _camera_of(view, pixels)))
        step()
    ends = _joined([look.ends for look in looks])
    for wanted in (count, 1.3 * count):  # what was left out the first time is made up for
        merged, kept = _checked(scene.field, ends, looks, min(wanted, len(ends.weights) / 2))
        if kept.sum() > 0.85 * count:
            break
    if not kept.any():
        raise NothingSolid("The learned scene shows nothing solid.", "Learn it again, with other settings.")
    return _described(scene.field, merged.part(kept))


def _described(field: Field, ends: _Ends) -> SurfacePoints:
    world = _to_world(field, ends.positions)
    distances, neighbors = tree_of(world).query(world, min(NEIGHBORS, len(world)))
    spacing = distances[:, 1 : NEAREST + 1].mean(1).astype(np.float32)
    normals = _normals(field, ends, world, neighbors)
    return SurfacePoints(ends.positions, world.astype(np.float32), normals, spacing, ends.colors, ends.viewdirs)


@dataclass(frozen=True)
class _Ends:
    """Where n rays end.

    Attributes:
        positions: [n, 3] grid coordinates.
        colors: [n, 3] sRGB.
        viewdirs: [n, 3] of unit length.
        weights: [n], how sharply they end: of a silhouette's ray, whose color is a mixture, little.
    """

    positions: np.ndarray
    colors: np.ndarray
    viewdirs: np.ndarray
    weights: np.ndarray

    def part(self, chosen: np.ndarray) -> _Ends:
        """Some of them."""
        return _Ends(self.positions[chosen], self.colors[chosen], self.viewdirs[chosen], self.weights[chosen])


@dataclass(frozen=True)
class _Look:
    """One view: its pinhole, depth [H, W] in world units (0: open), and the ends of its rays that end sharply."""

    camera: Camera
    depth: np.ndarray
    ends: _Ends


def _checked(field: Field, ends: _Ends, looks: Sequence[_Look], count: float) -> tuple[_Ends, np.ndarray]:
    """About this many points, [n], and which of them are not floaters, [n] bool."""
    if not len(ends.weights):
        return ends, np.zeros(0, bool)
    merged, cell = _merged(ends, field.voxel, count)
    world = _to_world(field, merged.positions)
    kept = _is_seen(world, _voxels_of(field, merged.positions), looks) & ~_is_lonely(merged.positions, cell)
    return merged, kept


def _camera_of(view: View, pixels: float) -> Camera:
    """A view's pinhole with about this many pixels."""
    camera = view.camera.without_distortion()
    factor = math.sqrt(pixels / (camera.width * camera.height))
    return camera.scaled(max(1, round(camera.width * factor)), max(1, round(camera.height * factor)))


def _look(scene: Scene, camera: Camera) -> _Look:
    picture = scene.render(camera, SAMPLES)
    cache, field = picture.cache, scene.field
    sharp = (cache.opacity > MIN_OPACITY) & (cache.spread < MOST_SPREAD * field.voxel)
    weights = torch.exp(-cache.spread / field.voxel) + 1e-4
    values = cache.positions[:, SAMPLES // 2], picture.color.view(-1, 3)[cache.index], cache.viewdirs, weights
    ends = _Ends(*[each[sharp].float().cpu().numpy() for each in values])
    depth = np.zeros(camera.width * camera.height)
    depth[cache.index.cpu().numpy()] = camera.project(_to_world(field, values[0].cpu().numpy()))[1]
    return _Look(camera, depth.reshape(camera.height, camera.width), ends)


def _joined(parts: Sequence[_Ends]) -> _Ends:
    return _Ends(
        *[
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("positions", "colors", "viewdirs", "weights")
        ]
    )


def _merged(ends: _Ends, voxel: float, count: float) -> tuple[_Ends, float]:
    """Means of the ends in cells of one size, about `count` of them, and that size."""
    cell = voxel
    for _ in range(8):
        found = len(np.unique(_cells_of(ends.positions, cell)))
        if abs(found / count - 1) < 0.03:
            break
        cell *= (found / count) ** 0.5  # a surface has as many cells as one over their size squared
    _, point = np.unique(_cells_of(ends.positions, cell), return_inverse=True)
    point = point.ravel()
    total = np.bincount(point, ends.weights)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(point, ends.weights * column) for column in values.T]
        return (np.stack(sums, 1) / total[:, None]).astype(np.float32)

    viewdirs = mean(ends.viewdirs)
    viewdirs /= np.maximum(np.linalg.norm(viewdirs, axis=1, keepdims=True), 1e-6)
    return _Ends(mean(ends.positions), mean(ends.colors), viewdirs, total / np.bincount(point)), cell


def _cells_of(positions: np.ndarray, cell: float) -> np.ndarray:
    """The number of the cell of each position, [n] int64."""
    cells = np.floor((positions - positions.min(0)) / cell).astype(np.int64)
    extent = cells.max(0) + 1
    return (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]


def _is_seen(world: np.ndarray, voxels: np.ndarray, looks: Sequence[_Look]) -> np.ndarray:
    """Which points [n, 3] at least two views end at, and no fewer than look through them.

    voxels: [n], how large the field's voxels are there, world units.
    """
    ending, passing = np.zeros(len(world), np.int32), np.zeros(len(world), np.int32)
    for look in looks:
        height, width = look.depth.shape
        pixels, depth = look.camera.project(world)
        column, row = np.floor(np.where(depth[:, None] > 0, pixels, -1)).clip(-1, max(height, width)).astype(int).T
        inside = np.flatnonzero((column >= 0) & (column < width) & (row >= 0) & (row < height))
        seen = look.depth[row[inside], column[inside]]
        behind = np.where(seen > 0, seen, np.inf) - depth[inside]
        tolerance = voxels[inside] + 0.5 * depth[inside] / look.camera.fx  # half a pixel of a slope
        ending[inside] += np.abs(behind) < tolerance
        passing[inside] += behind > tolerance
    return (ending >= min(2, len(looks))) & (ending >= passing)


def _is_lonely(positions: np.ndarray, cell: float) -> np.ndarray:
    """Which points [n, 3] have few neighbors."""
    distances, _ = tree_of(positions).query(positions, [7])
    return distances[:, 0] > OUTLIER_DISTANCE * cell


def _voxels_of(field: Field, positions: np.ndarray) -> np.ndarray:
    """How large voxels are at grid positions [n, 3], world units."""
    beside = np.repeat(positions[:, None], 3, 1) + field.voxel * np.eye(3, dtype=np.float32)
    steps = _to_world(field, beside) - _to_world(field, positions)[:, None]
    return np.linalg.norm(steps, axis=2).max(1)


def _to_world(field: Field, positions: np.ndarray) -> np.ndarray:
    return field.space.to_world(torch.from_numpy(positions).to(field.bounds.device)).cpu().numpy()


def _normals(field: Field, merged: _Ends, world: np.ndarray, neighbors: np.ndarray) -> np.ndarray:
    """Normals in the world's axes, [n, 3], on the side from which the points are seen, smoothed over neighbors [n, m]."""
    positions = torch.from_numpy(merged.positions).to(field.bounds.device)
    along = torch.cat([field.normals(some) for some in positions.split(1 << 17)]).cpu().numpy()
    normals = _unit(_to_world(field, merged.positions + field.voxel * along) - world, -merged.viewdirs)
    faces_away = (normals * merged.viewdirs).sum(1, keepdims=True) > 0
    normals = np.where(faces_away, -normals, normals)
    agree = np.einsum("nmc,nc->nm", normals[neighbors], normals) > 0  # not those of a thin thing's other side
    return _unit(np.einsum("nmc,nm->nc", normals[neighbors], agree), normals).astype(np.float32)


def _unit(vectors: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Vectors [n, 3] of unit length; `otherwise` where they have none."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), otherwise)
