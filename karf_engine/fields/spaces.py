"""Which space suits a capture, and where it lies there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from ..capture.camera import Camera
from ..capture.capture import SparsePoints, View
from ..errors import BadRequest
from ..project.settings import GeometrySettings, OpenSettings
from .extent import box_round_focus, looks_one_way, middle_pose, nearest_depth
from .rendering.space import Contraction, Frustum, Similarity

OPAQUE_REACH = 1.2  # half-width of the box before a real background, in units of what a camera sees at the focus point
IN_BOX = 0.98  # of the sparse points: then the box holds all there is to learn
FRUSTUM_DEPTH = 0.5  # half the frustum's grid depth, in half picture widths: depth is known less well than place
NEAR_SHARE = 0.75  # of the nearest depth, where the near plane is
NEAR = 0.1  # mean camera distances; nothing is looked for nearer to a camera


def choose_space(kind: str, views: list[View], points: SparsePoints | None, settings: GeometrySettings) -> str:
    """The space that suits cameras and points, unless the settings name one.

    Args:
        kind: Of the photos' background: alpha, black, white or opaque.
        views: The training views.
        points: As these views observe them, or None.
        settings: `settings.space` is `auto`, or the answer.

    Returns:
        box, contraction or frustum.
    """
    if settings.space != "auto":
        return settings.space
    if kind != "opaque":
        return "box"
    cameras = [view.camera for view in views]
    if looks_one_way(cameras) and nearest_depth(views, points) is not None:
        return "frustum"
    if points is None or not len(points):
        return "box"  # where open space is empty is not known
    center, half_width = box_round_focus(cameras, OPAQUE_REACH)
    inside = np.abs(points.positions - center.numpy()).max(1) < half_width
    return "box" if inside.mean() >= IN_BOX else "contraction"


def contraction_round_focus(cameras: list[Camera], recipe: OpenSettings) -> Contraction:
    """The contraction whose inner ball lies round the cameras' focus point, as large as what they see there."""
    center, radius = box_round_focus(cameras, recipe.radius)
    distance = float(np.mean([np.linalg.norm(camera.position - center.numpy()) for camera in cameras]))
    return Contraction(center.float(), radius, recipe.room, NEAR * distance)


def middle_frustum(views: list[View], points: SparsePoints | None) -> Frustum:
    """The frustum of a camera amid all, oriented as they are on average.

    Raises:
        BadRequest: How near the scene is is not known.
    """
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


def similarity(scale: float, world_to_grid: np.ndarray, center: np.ndarray) -> Similarity:
    """The space in whose origin `center` [3] lies, rotated by [3, 3] and scaled."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * world_to_grid
    matrix[:3, 3] = -scale * world_to_grid @ center
    return Similarity(torch.from_numpy(matrix).float())


def ndc(frustum: Frustum, views: list[View]) -> Frustum:
    """The same frustum with the coordinates of NeRF's NDC: the picture's edges, the near plane and infinity at +-1."""
    aspect = np.mean([view.camera.width / view.camera.height for view in views])
    return replace(frustum, focal=frustum.focal * torch.tensor([1.0, aspect], dtype=torch.float32), depth_scale=1.0)
