"""Few photos from far apart: what the field shows between them, for Gaussians to be held to.

No photo tells a Gaussian from one that hangs before a camera that took none. The field was held against that by priors of
its own (`fields/wide_baseline.py`), so its pictures are worth more there than nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..fields.extent import focus_point, upright_axes
from ..fields.scene import Scene
from ..fields.wide_baseline import is_wide
from ..io.color import to_bytes
from .fit import Photo

PICTURES = 6  # a photo
SIDE = 256  # pixels of a picture at most: the field is no finer


def cameras_between(scene: Scene, cameras: Sequence[Camera], seed: int) -> list[Camera]:
    """Cameras between those of the photos, where these stand far apart; else none.

    PICTURES for each photo: its camera, turned all round what the photos look at about what is up, by even steps from a
    random angle. So new cameras of the photos' heights are never far from one, on whatever side.

    Args:
        scene: As learned.
        cameras: Pinholes of the photos.
        seed: Of the angles.
    """
    focus = focus_point(list(cameras))
    if scene.background_kind != "opaque" or not is_wide(list(cameras), focus):
        return []
    up, random = upright_axes(list(cameras))[2], np.random.default_rng([seed, 2])
    found = []
    for camera in cameras:
        for angle in 2 * np.pi * (np.arange(PICTURES) + random.random()) / PICTURES:
            turn = Rotation.from_rotvec(angle * up).as_matrix()
            pose = camera.camera_to_world.copy()
            pose[:3, :3] = turn @ pose[:3, :3]
            pose[:3, 3] = focus.numpy() + turn @ (camera.position - focus.numpy())
            found.append(replace(camera, camera_to_world=pose))
    return found


def pictures_of(scene: Scene, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None) -> list[Photo]:
    """What the field shows from these cameras, to be learned from as photos are.

    Args:
        scene: As learned.
        cameras: Pinholes; their pictures are of at most SIDE pixels.
        step: Called after each picture; may raise Cancelled.
    """
    pictures = []
    for camera in cameras:
        factor = min(1.0, SIDE / max(camera.width, camera.height))
        small = camera.scaled(max(1, round(factor * camera.width)), max(1, round(factor * camera.height)))
        pictures.append(Photo(small, to_bytes(scene.render(small, 1).color.cpu().numpy()), None, None))
        step()
    return pictures
