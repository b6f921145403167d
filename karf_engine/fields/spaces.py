"""The choice of a space for a capture, and its parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..errors import BadRequest
from ..project.settings import GeometrySettings, OpenSettings
from .extent import box_around_focus, is_forward_facing, mean_pose, min_depth
from .rendering.space import Contraction, Frustum, Similarity

OPAQUE_REACH = 1.2  # half-width of the box before a real background, as `reach` of `box_around_focus`
IN_BOX = 0.98  # smallest share of sparse points inside that box for the box to suit the scene
FRUSTUM_DEPTH = 0.5  # half the frustum's grid depth, in half image widths
NEAR_SHARE = 0.75  # near plane of a frustum, share of the smallest depth
NEAR = 0.1  # near distance of a contraction, mean camera distances


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
