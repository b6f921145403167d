"""Gaussians from a learned field: flat disks on its surface with its mean colors, and a shell far away for what is behind.

A field learned in a minute is a far better start than points: what it knows of the surface is worth 9 dB.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch

from ..capture.capture import View
from ..fields.scene import Scene
from ..fields.scene_surface import SurfacePoints, surface_points
from .gaussians import Gaussians
from .kernels.arrays import C0, CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION

MOST_VIEWS = 64  # that look for the surface
FLATNESS = 0.2  # of a disk: thickness by width
OPACITY, OPACITY_BEHIND = 0.8, 0.9
BEHIND, BEHIND_DISTANCE = 8000, 15.0  # Gaussians of the shell; its radius by the distance of the farthest camera
BEHIND_SIZE = 1.0  # of its Gaussians, by the distance between them: fewer overlap in blotches
NEAREST = 0.02  # of the distance at which a camera typically sees the surface: what is nearer is not shown


def gaussians_of(
    scene: Scene, views: Sequence[View], count: int, degree: int, step: Callable[[], None] = lambda: None
) -> Gaussians:
    """Gaussians to begin with, whose colors are the same from everywhere.

    Args:
        scene: As learned.
        views: Whose cameras look at it.
        count: About how many.
        degree: Of the spherical harmonics, 0 to 3.
        step: Called after each view that was rendered, `len(surface_views(views))` in all; may raise Cancelled.

    Raises:
        NothingSolid: The scene has no surface.
    """
    points = surface_points(scene, surface_views(views), count, step)
    eyes = np.stack([view.camera.position for view in views])
    near = nearest_shown(points.world, eyes)
    table, n_behind = _disks(points, (degree + 1) ** 2), 0
    if scene.background is not None:
        shell = _shell(scene, points.world, eyes, (degree + 1) ** 2)
        table, n_behind = np.concatenate([table, shell]), len(shell)
    behind = scene.behind(torch.tensor([[0.0, 0.0, 1.0]])) if n_behind == 0 else torch.zeros(1, 3)
    return Gaussians(table, n_behind, tuple(behind[0].tolist()), near)


def nearest_shown(centers: np.ndarray, eyes: np.ndarray) -> float:
    """The depth up to which nothing is shown, of a scene with these centers [n, 3] that is looked at from [m, 3]."""
    return float(NEAREST * np.median(np.linalg.norm(np.median(centers, 0) - eyes, axis=1)))


def surface_views(views: Sequence[View]) -> list[View]:
    """The views from which the surface is looked for: at most MOST_VIEWS, evenly chosen."""
    numbers = np.linspace(0, len(views) - 1, min(len(views), MOST_VIEWS)).round().astype(int)
    return [views[number] for number in numbers]


def _disks(points: SurfacePoints, n_harmonics: int) -> np.ndarray:
    table = np.zeros((len(points.world), COLOR + 3 * n_harmonics), np.float32)
    table[:, CENTER : CENTER + 3] = points.world
    table[:, LOG_SCALE : LOG_SCALE + 3] = np.log(0.5 * np.maximum(points.spacing, 1e-9))[:, None]
    table[:, LOG_SCALE + 2] += np.log(FLATNESS)
    table[:, ROTATION : ROTATION + 4] = _turned_to(points.normals)
    table[:, LOGIT] = _logit(OPACITY)
    table[:, COLOR : COLOR + 3] = (points.colors - 0.5) / C0
    return table


@torch.no_grad()
def _shell(scene: Scene, world: np.ndarray, eyes: np.ndarray, n_harmonics: int) -> np.ndarray:
    """Large balls far away on an even spiral, in the colors of the scene's background."""
    middle, number = np.median(world, 0), np.arange(BEHIND) + 0.5
    radius = BEHIND_DISTANCE * np.linalg.norm(eyes - middle, axis=1).max()
    z, turn = 1 - 2 * number / BEHIND, np.pi * (1 + 5**0.5) * number
    level = np.sqrt(1 - z * z)
    directions = np.stack([np.cos(turn) * level, np.sin(turn) * level, z], 1).astype(np.float32)
    table = np.zeros((BEHIND, COLOR + 3 * n_harmonics), np.float32)
    table[:, CENTER : CENTER + 3] = middle + radius * directions
    table[:, LOG_SCALE : LOG_SCALE + 3] = np.log(BEHIND_SIZE * radius * np.sqrt(4 * np.pi / BEHIND))
    table[:, ROTATION] = 1
    table[:, LOGIT] = _logit(OPACITY_BEHIND)
    colors = scene.behind(torch.from_numpy(directions).to(scene.field.bounds.device)).cpu().numpy()
    table[:, COLOR : COLOR + 3] = (colors - 0.5) / C0
    return table


def _turned_to(normals: np.ndarray) -> np.ndarray:
    """Quaternions w x y z [n, 4] that turn the z axis to unit normals [n, 3]."""
    x, y, z = normals.T
    quaternions = np.stack([1 + z, -y, x, np.zeros_like(x)], 1)
    quaternions[z < -0.9999] = (0, 1, 0, 0)
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))
