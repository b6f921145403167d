"""Pictures of the field from cameras between distant photos, used as additional photos.

Photos far apart do not constrain a Gaussian that floats in front of a camera that took none. The field's own priors
(fields/priors.py) do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..fields.extent import focus_point, is_wide_baseline, upright_axes
from ..fields.scene import Scene
from ..io.color import to_bytes
from .fit import Photo

PSEUDO_VIEWS_PER_PHOTO = 6  # per photo
SIDE = 256  # largest side of a picture, pixels; the field has no finer detail


def pseudo_cameras(scene: Scene, cameras: Sequence[Camera], seed: int) -> list[Camera]:
    """Return PICTURES cameras per photo, rotated about the up axis through the focus point in even steps.

    Args:
        scene: Learned scene.
        cameras: Pinholes of the photos.
        seed: Seed of the first angle of each photo.

    Returns:
        Cameras; none unless the photos have wide baselines and an opaque background.
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
    """Render the field from cameras.

    Args:
        scene: Learned scene.
        cameras: Pinholes; pictures are scaled down to at most SIDE pixels.
        step: Called after each picture; may raise Cancelled.
    """
    pictures = []
    for camera in cameras:
        factor = min(1.0, SIDE / max(camera.width, camera.height))
        small = camera.scaled(max(1, round(factor * camera.width)), max(1, round(factor * camera.height)))
        pictures.append(Photo(small, to_bytes(scene.render(small, 1).color.cpu().numpy()), None, None))
        step()
    return pictures
