"""Initial Gaussians from a learned field, and its pictures between distant photos.

Initial Gaussians are flat disks on its surface in its mean colors, and a distant background shell. Photos far apart do not
constrain a Gaussian that floats in front of a camera that took none; the field's own priors (fields/priors.py) do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..capture.capture import View
from ..fields.extent import focus_point, is_wide_baseline, upright_axes
from ..fields.scene import Scene
from ..fields.scene_surface import SurfacePoints, surface_points
from ..io.color import to_bytes
from .gaussians import Gaussians, near_plane
from .kernels.arrays import C0, CENTER, COLOR, LOG_SCALE, LOGIT, ROTATION

if TYPE_CHECKING:
    from .fit import Photo

MAX_VIEWS = 64  # that sample the surface
FLATNESS = 0.2  # thickness / width of a disk
OPACITY, OPACITY_BEHIND = 0.8, 0.9
PSEUDO_VIEWS_PER_PHOTO = 6
SIDE = 256  # largest side of such a picture, pixels; the field has no finer detail
BEHIND, BEHIND_DISTANCE = 40_000, 15.0  # Gaussians of the shell; its radius in distances of the farthest camera
BEHIND_SCALE = 0.75  # their scale in distances between them: smaller ones would leave gaps


def initial_gaussians(
    scene: Scene, views: Sequence[View], count: int, degree: int, step: Callable[[], None] = lambda: None
) -> Gaussians:
    """Return about `count` initial Gaussians with view-independent colors and harmonics of a degree of 0 to 3.

    step: called after each of `surface_views(views)`; may raise Cancelled. Raises NoSurface.
    """
    points = surface_points(scene, surface_views(views), count, step)
    eyes = np.stack([view.camera.position for view in views])
    near = near_plane(points.world_positions, eyes)
    table, n_behind = _disks(points, (degree + 1) ** 2), 0
    if scene.background is not None:
        shell = _shell(scene, points.world_positions, eyes, (degree + 1) ** 2)
        table, n_behind = np.concatenate([table, shell]), len(shell)
    behind = scene.background_color(torch.tensor([[0.0, 0.0, 1.0]])) if n_behind == 0 else torch.zeros(1, 3)
    red, green, blue = behind[0].tolist()
    return Gaussians(table, n_behind, (red, green, blue), near)


def surface_views(views: Sequence[View]) -> list[View]:
    """Choose at most MAX_VIEWS views evenly."""
    numbers = np.linspace(0, len(views) - 1, min(len(views), MAX_VIEWS)).round().astype(int)
    return [views[number] for number in numbers]


def _disks(points: SurfacePoints, n_harmonics: int) -> np.ndarray:
    table = np.zeros((len(points.world_positions), COLOR + 3 * n_harmonics), np.float32)
    table[:, CENTER : CENTER + 3] = points.world_positions
    table[:, LOG_SCALE : LOG_SCALE + 3] = np.log(0.5 * np.maximum(points.spacing, 1e-9))[:, None]
    table[:, LOG_SCALE + 2] += np.log(FLATNESS)
    table[:, ROTATION : ROTATION + 4] = _rotations_to(points.normals)
    table[:, LOGIT] = _logit(OPACITY)
    table[:, COLOR : COLOR + 3] = (points.colors - 0.5) / C0
    return table


@torch.no_grad()
def _shell(scene: Scene, world: np.ndarray, eyes: np.ndarray, n_harmonics: int) -> np.ndarray:
    """Return spheres in the background's colors on a distant Fibonacci sphere."""
    middle, number = np.median(world, 0), np.arange(BEHIND) + 0.5
    radius = BEHIND_DISTANCE * np.linalg.norm(eyes - middle, axis=1).max()
    z, azimuth = 1 - 2 * number / BEHIND, np.pi * (1 + 5**0.5) * number
    level = np.sqrt(1 - z * z)
    directions = np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, z], 1).astype(np.float32)
    table = np.zeros((BEHIND, COLOR + 3 * n_harmonics), np.float32)
    table[:, CENTER : CENTER + 3] = middle + radius * directions
    table[:, LOG_SCALE : LOG_SCALE + 3] = np.log(BEHIND_SCALE * radius * np.sqrt(4 * np.pi / BEHIND))
    table[:, ROTATION] = 1
    table[:, LOGIT] = _logit(OPACITY_BEHIND)
    colors = scene.background_color(torch.from_numpy(directions).to(scene.field.bounds.device)).cpu().numpy()
    table[:, COLOR : COLOR + 3] = (colors - 0.5) / C0
    return table


def _rotations_to(normals: np.ndarray) -> np.ndarray:
    """Return quaternions w x y z [n, 4] that rotate the z axis to unit normals [n, 3]."""
    x, y, z = normals.T
    quaternions = np.stack([1 + z, -y, x, np.zeros_like(x)], 1)
    quaternions[z < -0.9999] = (0, 1, 0, 0)
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def _logit(probability: float) -> float:
    return float(np.log(probability / (1 - probability)))


def pseudo_cameras(scene: Scene, cameras: Sequence[Camera], seed: int) -> list[Camera]:
    """Return PSEUDO_VIEWS_PER_PHOTO cameras per photo, rotated about the up axis through the focus point in even steps.

    There are none unless the photos have wide baselines and an opaque background. seed: of the first angle of each photo.
    """
    focus = focus_point(list(cameras))
    if scene.background_kind != "opaque" or not is_wide_baseline(list(cameras), focus):
        return []
    up, random = upright_axes(list(cameras))[2], np.random.default_rng([seed, 2])
    found = []
    for camera in cameras:
        for angle in 2 * np.pi * (np.arange(PSEUDO_VIEWS_PER_PHOTO) + random.random()) / PSEUDO_VIEWS_PER_PHOTO:
            rotation = Rotation.from_rotvec(angle * up).as_matrix()
            pose = camera.camera_to_world.copy()
            pose[:3, :3] = rotation @ pose[:3, :3]
            pose[:3, 3] = focus.numpy() + rotation @ (camera.position - focus.numpy())
            found.append(replace(camera, camera_to_world=pose))
    return found


def render_pseudo_photos(
    scene: Scene, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None
) -> list[Photo]:
    """Render the field from pinholes, at most SIDE pixels large. step: called after each; may raise Cancelled."""
    from .fit import Photo

    pictures = []
    for camera in cameras:
        small = camera.reduced(SIDE)
        pictures.append(Photo(small, to_bytes(scene.render(small, 1).color.cpu().numpy()), None, None))
        step()
    return pictures
