"""The extent of a scene, the space that suits it, and the detail of its voxels, from cameras and sparse points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..errors import BadRequest
from ..io.images import resize
from ..project.settings import GeometrySettings, OpenSettings
from .rendering.space import Contraction, Frustum, Similarity, Space, space_to_device

FORWARD_FACING = 30.0  # degrees; largest angle between an optical axis and their mean
WIDE_BASELINE = 22.0  # degrees, median over cameras, to the second nearest neighbor as seen from their focus
NEAREST = 0.01  # quantile of a camera's point depths; nearer points are outliers
FARTHEST = 0.99  # quantile of a camera's point depths; farther points are outliers
RELIABLE_ERROR = 1.5  # pixels of reprojection error above the median; points beyond are unreliable
FEWEST_VIEWS = 3  # views that must observe a reliable point: two may agree on a mismatch
OPAQUE_REACH = 1.2  # half-width of the box before a real background, as `reach` of `box_around_focus`
IN_BOX = 0.98  # smallest share of sparse points inside that box for the box to suit the scene
FRUSTUM_DEPTH = 0.5  # half the frustum's grid depth, in half image widths
NEAR_SHARE = 0.75  # near plane of a frustum, share of the smallest depth
NEAR = 0.1  # near distance of a contraction, mean camera distances
DIFFERENCE = 0.5  # of central differences, pixels


def is_forward_facing(cameras: list[Camera]) -> bool:
    """Return whether cameras are forward-facing: all optical axes are near their mean."""
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    mean = axes.mean(0)
    return bool((axes @ mean >= np.cos(np.radians(FORWARD_FACING)) * np.linalg.norm(mean)).all())


def is_wide_baseline(cameras: list[Camera], center: Tensor) -> bool:
    """Return whether a capture consists of few photos from distant cameras. center: their focus [3], world units."""
    if len(cameras) < 3:
        return False
    directions = np.stack([camera.position for camera in cameras]) - center.cpu().numpy()
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    second_nearest = np.sort(angles, 1)[:, 2]  # the first is the camera itself
    return bool(np.degrees(np.median(second_nearest)) > WIDE_BASELINE)


def focus_point(cameras: list[Camera]) -> Tensor:
    """Return the point [3] float64 closest to all optical axes, by least squares."""
    poses = torch.stack([torch.from_numpy(c.camera_to_world) for c in cameras])
    axes = nn.functional.normalize(-poses[:, :3, 2], dim=1)
    projectors = torch.eye(3, dtype=axes.dtype) - axes[:, :, None] * axes[:, None, :]
    # a slight pull to the mean camera position makes the system solvable for parallel axes
    pull = 1e-6 * torch.eye(3, dtype=axes.dtype) * len(cameras)
    right = (projectors @ poses[:, :3, 3, None]).sum(0)[:, 0] + pull @ poses[:, :3, 3].mean(0)
    return torch.linalg.solve(projectors.sum(0) + pull, right)


def box_around_focus(cameras: list[Camera], reach: float) -> tuple[Tensor, float]:
    """Return a cube around the focus point: center [3] float64 and half-width, world units.

    `reach` is its half-width in median half-widths of the visible area at the focus point.
    """
    center = focus_point(cameras)
    half_widths = [
        float(torch.linalg.norm(torch.from_numpy(c.position) - center)) * max(c.width / c.fx, c.height / c.fy) / 2
        for c in cameras
    ]
    return center, reach * sorted(half_widths)[len(half_widths) // 2]


def upright_axes(cameras: list[Camera]) -> np.ndarray:
    """Return two horizontal directions and up, rows [3, 3], of cameras with roughly horizontal x axes."""
    right = np.stack([camera.camera_to_world[:3, 0] for camera in cameras])
    axes = np.linalg.eigh(right.T @ right)[1].T[::-1].copy()  # the last is perpendicular to most x axes
    axes[2] *= np.sign(axes[2] @ sum(camera.camera_to_world[:3, 1] for camera in cameras))
    return axes


def mean_pose(cameras: list[Camera]) -> np.ndarray:
    """Return the mean camera-to-world pose [4, 4] (LLFF's recentering)."""
    poses = np.stack([camera.camera_to_world for camera in cameras])
    back = poses[:, :3, 2].mean(0)
    right = np.cross(poses[:, :3, 1].mean(0), back)
    middle = np.eye(4)
    middle[:3, 2] = back / np.linalg.norm(back)
    middle[:3, 0] = right / np.linalg.norm(right)
    middle[:3, 1] = np.cross(middle[:3, 2], middle[:3, 0])
    middle[:3, 3] = poses[:, :3, 3].mean(0)
    return middle


def min_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Return the smallest depth in any view, world units: as declared, else from sparse points, else None."""
    declared = [view.depth_bounds[0] for view in views if view.depth_bounds]
    return min(declared or _point_depths(views, points, NEAREST), default=None)


def max_depth(views: list[View], points: SparsePoints | None) -> float | None:
    """Return the largest depth in any view, world units, as `min_depth` does."""
    declared = [view.depth_bounds[1] for view in views if view.depth_bounds]
    return max(declared or _point_depths(views, points, FARTHEST), default=None)


def _point_depths(views: list[View], points: SparsePoints | None, quantile: float) -> list[float]:
    """Return this quantile of the point depths of each camera that observes points."""
    found = []
    if points is None:
        return found
    for number, view in enumerate(views):
        _, depth = view.camera.project(points.positions[points.point[points.view == number]])
        if (depth > 0).any():
            found.append(float(np.quantile(depth[depth > 0], quantile)))
    return found


def reliable_points(points: SparsePoints) -> np.ndarray:
    """Return the positions [n, 3] of points with a small error and at least FEWEST_VIEWS observations."""
    observed = np.bincount(points.point, minlength=len(points)) >= FEWEST_VIEWS
    return points.positions[observed & is_reliable(points)]


def is_reliable(points: SparsePoints) -> np.ndarray:
    """Return whether the reprojection error of each point is small or unknown, [n] bool."""
    return ~(points.errors > np.nanmedian(points.errors) + RELIABLE_ERROR)


def choose_space(kind: str, views: list[View], points: SparsePoints | None, settings: GeometrySettings) -> str:
    """Return box, contraction or frustum: the space in the settings, or what suits cameras and points."""
    if settings.space != "auto":
        return settings.space
    if kind != "opaque":
        return "box"
    cameras = [view.camera for view in views]
    if is_forward_facing(cameras) and min_depth(views, points) is not None:
        return "frustum"
    if points is None or not len(points):
        return "box"  # free space is unknown
    center, half_width = box_around_focus(cameras, OPAQUE_REACH)
    inside = np.abs(points.positions - center.numpy()).max(1) < half_width
    return "box" if inside.mean() >= IN_BOX else "contraction"


def contraction_around_focus(cameras: list[Camera], recipe: OpenSettings) -> Contraction:
    """Return the contraction whose inner ball covers what the cameras see around their focus point."""
    center, radius = box_around_focus(cameras, recipe.radius)
    distance = float(np.mean([np.linalg.norm(camera.position - center.numpy()) for camera in cameras]))
    return Contraction(center.float(), radius, recipe.room, NEAR * distance)


def mean_frustum(views: list[View], points: SparsePoints | None) -> Frustum:
    """Return the frustum of the mean camera pose.

    Raises:
        BadRequest: The depth of the scene is unknown.
    """
    cameras = [view.camera for view in views]
    near = min_depth(views, points)
    if near is None:
        raise BadRequest(
            "A frustum needs to know how near the scene is.",
            "Use geometry.space=contraction, or a capture with points.",
        )
    focal = 2 * np.mean([[camera.fx, camera.fy] for camera in cameras], 0) / np.mean([c.width for c in cameras])
    world_to_camera = torch.from_numpy(np.linalg.inv(mean_pose(cameras))).float()
    return Frustum(world_to_camera, torch.from_numpy(focal).float(), NEAR_SHARE * near, FRUSTUM_DEPTH)


def similarity(scale: float, world_to_grid: np.ndarray, center: np.ndarray) -> Similarity:
    """Return the similarity that moves `center` [3] to the origin, rotates by [3, 3] and scales."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * world_to_grid
    matrix[:3, 3] = -scale * world_to_grid @ center
    return Similarity(torch.from_numpy(matrix).float())


def to_ndc(frustum: Frustum, views: list[View]) -> Frustum:
    """Return the frustum in NeRF's NDC: image edges, near plane and infinity at +-1."""
    aspect = np.mean([view.camera.width / view.camera.height for view in views])
    return replace(frustum, focal=frustum.focal * torch.tensor([1.0, aspect], dtype=torch.float32), depth_scale=1.0)


def pixels_per_voxel(space: Space, voxel: float, positions: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the mean size in pixels, float64 [n], of a voxel of `voxel` grid units at world positions [n, 3].

    It is nan behind the camera, which has no lens distortion.
    """
    space = space_to_device(space, "cpu")
    _, depth = camera.project(positions)
    depth = np.where(depth > 0, depth, np.nan)
    steps = []
    for axis, focal in enumerate((camera.fx, camera.fy)):
        across = DIFFERENCE * (depth / focal)[:, None] * camera.camera_to_world[:3, axis]
        ahead, behind = (space.to_grid(torch.from_numpy(positions + sign * across).float()) for sign in (1, -1))
        steps.append(torch.linalg.norm(ahead - behind, dim=1).double().numpy() / (2 * DIFFERENCE))
    return voxel / np.mean(steps, 0)


def typical_pixels_per_voxel(space: Space, voxel: float, views: Sequence[View], points: SparsePoints | None) -> float:
    """Return the median size of a voxel in pixels over all observed points, or at the focus point without any.

    The views have cameras of the image sizes, without lens distortion; the points are as these views observe them.
    """
    focus = focus_point([view.camera for view in views]).numpy()[None]
    sizes = []
    for number, view in enumerate(views):
        if points is None or not len(points.view):
            positions = focus
        else:
            positions = points.positions[points.point[points.view == number]]
        sizes.append(pixels_per_voxel(space, voxel, positions, view.camera))
    return float(np.nanmedian(np.concatenate(sizes)))


def remove_detail(photo: np.ndarray, pixels: float) -> np.ndarray:
    """Average a float photo [H, W, 3] over voxels of `pixels` >= 1, and interpolate linearly."""
    height, width = photo.shape[:2]
    reduced = resize(photo, max(1, round(width / max(pixels, 1))), max(1, round(height / max(pixels, 1))))
    return resize(reduced, width, height)


def psnr_without_detail(photos: Sequence[np.ndarray], pixels: float) -> list[float]:
    """Return the PSNR in dB of each photo without detail of this many pixels, about what such voxels can reach."""
    return [cv2.PSNR(remove_detail(photo, pixels).astype(float), photo.astype(float), 1.0) for photo in photos]
