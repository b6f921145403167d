"""Which space suits a capture, and the fit that begins there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..errors import BadRequest
from ..rendering.rays import PixelBank
from ..rendering.space import Contraction, Frustum, Similarity, Space, space_on
from ..runtime import Runtime
from ..settings import GeometrySettings, Level, NerfSettings, OpenSettings
from .nerf.field import NerfSampling
from .nerf.fit import NerfFit, start_nerf_fit
from .voxels.fit import Fit
from .voxels.fit_box import OPAQUE_REACH, focus_point, start_box, start_box_fit
from .voxels.fit_open import Sightings, start_open_fit

IN_BOX = 0.98  # of the sparse points: then the box holds all there is to learn
SAME_WAY = 30.0  # degrees between any camera's axis and their mean: then they look one way
FRUSTUM_DEPTH = 0.5  # half the frustum's grid depth, in half picture widths: depth is known less well than place
NEAREST = 0.01  # of a camera's sparse points may be nearer than its nearest depth: mistakes
NEAR_SHARE = 0.75  # of the nearest depth, where the near plane is
NEAR = 0.1  # mean camera distances; nothing is looked for nearer to a camera
RELIABLE_ERROR = 1.5  # pixels of reprojection error, over the median: points above it are left out
OBJECT_DISTANCE = 4.0  # of the cameras, in a NeRF's own units: that of the NeRF-synthetic captures
OBJECT_RANGE = (0.5, 1.5)  # of that distance is sampled: 2 to 6 there
OPEN_RANGE = (0.1, 20.0)  # of it, where nothing tells how near and far the scene is
POINT_RANGE = (0.9, 1.1)  # of the nearest and farthest sparse point
FARTHEST = 0.99  # of a camera's sparse points may not be farther than its farthest depth: mistakes


def choose_space(kind: str, views: list[View], points: SparsePoints | None, settings: GeometrySettings) -> str:
    """box, contraction or frustum, for photos with this background: as set, or what suits cameras and points."""
    if settings.space != "auto":
        return settings.space
    if kind != "opaque":
        return "box"
    cameras = [view.camera for view in views]
    if looks_one_way(cameras) and nearest_depth(views, points) is not None:
        return "frustum"
    if points is None or not len(points):
        return "box"  # nothing tells where open space is empty
    center, half_width = start_box(cameras, OPAQUE_REACH)
    inside = np.abs(points.positions - center.numpy()).max(1) < half_width
    return "box" if inside.mean() >= IN_BOX else "contraction"


def start_fit(
    bank: PixelBank,
    kind: str,
    space_name: str,
    views: list[View],
    points: SparsePoints | None,
    settings: GeometrySettings,
    runtime: Runtime,
) -> Fit | NerfFit:
    """A fresh fit in the space of this name. views: those of the bank, at its size. points: of these views."""
    if settings.field == "nerf":
        space, sampling = nerf_place(kind, space_name, views, points, settings.nerf)
        return start_nerf_fit(bank, kind, space_on(space, runtime.device), sampling, settings.nerf, runtime)
    if space_name == "box":
        return start_box_fit(bank, kind, settings, runtime)
    recipe = settings.open
    if space_name == "frustum":
        space = middle_frustum(views, points)
        recipe = replace(recipe, levels=tuple(_finer(level, recipe.frustum_detail) for level in recipe.levels))
    else:
        space = _contraction(bank.cameras, recipe)
    space = space_on(space, runtime.device)
    return start_open_fit(bank, space, recipe, settings.features, sightings_of(bank, space, points), runtime)


def _finer(level: Level, factor: float) -> Level:
    return replace(level, voxels=round(factor * level.voxels))


def looks_one_way(cameras: list[Camera]) -> bool:
    """Whether all optical axes are within SAME_WAY of their mean."""
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    mean = axes.mean(0)
    return bool((axes @ mean >= np.cos(np.radians(SAME_WAY)) * np.linalg.norm(mean)).all())


def nearest_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Depth of the nearest thing before any camera, world units: as declared, else of its sparse points, else None."""
    declared = [view.depth_bounds[0] for view in views if view.depth_bounds]
    return min(declared or _point_depths(views, points, NEAREST), default=None)


def farthest_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Depth of the farthest thing before any camera, world units, likewise."""
    declared = [view.depth_bounds[1] for view in views if view.depth_bounds]
    return max(declared or _point_depths(views, points, FARTHEST), default=None)


def _point_depths(views: list[View], points: SparsePoints | None, quantile: float) -> list[float]:
    """This quantile of the depths of each camera's sparse points, where it sees some."""
    found = []
    for number, view in enumerate(views if points is not None else ()):
        _, depth = view.camera.project(points.positions[points.point[points.view == number]])
        if (depth > 0).any():
            found.append(float(np.quantile(depth[depth > 0], quantile)))
    return found


def _contraction(cameras: list[Camera], recipe: OpenSettings) -> Contraction:
    center = focus_point(cameras)
    distance = float(np.mean([np.linalg.norm(camera.position - center.numpy()) for camera in cameras]))
    return Contraction(center.float(), recipe.radius * distance, recipe.room, NEAR * distance)


def nerf_place(
    kind: str, space_name: str, views: list[View], points: SparsePoints | None, settings: NerfSettings
) -> tuple[Space, NerfSampling]:
    """Where a NeRF lies in the world, and where its rays are sampled.

    Cameras that look one way: NDC. Objects: the cameras stand OBJECT_DISTANCE round them. Scenes that go on all round:
    the cameras stand at a distance of 1, and samples are even in disparity up to the farthest point.
    """
    counts = {"coarse": settings.coarse_samples, "fine": settings.fine_samples}
    if space_name == "frustum":
        return ndc(middle_frustum(views, points), views), NerfSampling(0.0, 1.0, **counts)
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distances = np.array([np.linalg.norm(camera.position - center) for camera in cameras])
    is_open = kind == "opaque"
    near, far = _open_range(views, points, distances) if is_open else distances.mean() * np.array(OBJECT_RANGE)
    scale = (1.0 if is_open else OBJECT_DISTANCE) / distances.mean()
    space = similarity(scale, np.eye(3), center)
    return space, NerfSampling(settings.near or float(near), settings.far or float(far), is_open, **counts)


def similarity(scale: float, world_to_grid: np.ndarray, center: np.ndarray) -> Similarity:
    """The space in whose origin `center` [3] lies, turned by a rotation [3, 3] and scaled."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * world_to_grid
    matrix[:3, 3] = -scale * world_to_grid @ center
    return Similarity(torch.from_numpy(matrix).float())


def ndc(frustum: Frustum, views: list[View]) -> Frustum:
    """The same frustum with the coordinates of NeRF's NDC: the picture's edges, the near plane and infinity at +-1."""
    aspect = np.mean([view.camera.width / view.camera.height for view in views])
    return replace(frustum, focal=frustum.focal * torch.tensor([1.0, aspect], dtype=torch.float32), depth_scale=1.0)


def _open_range(views: list[View], points: SparsePoints | None, distances: np.ndarray) -> tuple[float, float]:
    """Nearest and farthest distance at which an open scene is looked for, world units."""
    near, far = nearest_depth(views, points), farthest_depth(views, points)
    near = distances.mean() * OPEN_RANGE[0] if near is None else near * POINT_RANGE[0]
    far = distances.mean() * OPEN_RANGE[1] if far is None else far * POINT_RANGE[1]
    return float(near), float(far)


def middle_frustum(views: list[View], points: SparsePoints | None) -> Frustum:
    """The frustum of a camera amid all, turned as they are on average."""
    cameras = [view.camera for view in views]
    near = nearest_depth(views, points)
    if near is None:
        raise BadRequest(
            "A frustum needs to know how near the scene is.",
            "Use geometry.space=contraction, or a capture with points.",
        )
    focal = 2 * np.mean([[camera.fx, camera.fy] for camera in cameras], 0) / np.mean([c.width for c in cameras])
    world_to_camera = torch.from_numpy(np.linalg.inv(middle_pose(cameras))).float()
    return Frustum(world_to_camera, torch.from_numpy(focal).float(), NEAR_SHARE * near, FRUSTUM_DEPTH)


def middle_pose(cameras: list[Camera]) -> np.ndarray:
    """Camera to world [4, 4] of a camera amid all, turned as they are on average (LLFF's recentering)."""
    poses = np.stack([camera.camera_to_world for camera in cameras])
    back = poses[:, :3, 2].mean(0)
    right = np.cross(poses[:, :3, 1].mean(0), back)
    middle = np.eye(4)
    middle[:3, 2] = back / np.linalg.norm(back)
    middle[:3, 0] = right / np.linalg.norm(right)
    middle[:3, 1] = np.cross(middle[:3, 2], middle[:3, 0])
    middle[:3, 3] = poses[:, :3, 3].mean(0)
    return middle


def sightings_of(bank: PixelBank, space: Space, points: SparsePoints | None) -> Sightings:
    """The pixels of the bank that see a reliable sparse point."""
    index, positions = [torch.zeros(0, dtype=torch.long)], [torch.zeros(0, 3)]
    if points is not None and len(points):
        limit = np.nanmedian(points.errors) + RELIABLE_ERROR
        reliable = ~(points.errors > limit)
        for number, camera in enumerate(bank.cameras):
            seen = points.point[points.view == number]
            world = points.positions[seen[reliable[seen]]]
            pixels, depth = camera.project(world)
            cells = np.floor(pixels).astype(int)
            inside = (depth > 0) & ((cells >= 0) & (cells < (camera.width, camera.height))).all(1)
            index.append(int(bank.first[number]) + torch.from_numpy(cells[inside] @ (1, camera.width)))
            positions.append(torch.from_numpy(world[inside]).float())
    device = bank.color.device
    return Sightings(torch.cat(index).to(device), space.to_grid(torch.cat(positions).to(device)))
