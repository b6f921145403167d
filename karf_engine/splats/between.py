"""Few photos from far apart: what the field shows between them, for Gaussians to be held to.

No photo tells a Gaussian from one that hangs before a camera that took none. The field was held against that by priors of
its own (`fields/wide_baseline.py`), so its pictures are worth more there than nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..capture.camera import Camera
from ..compute.neighbors import tree_of
from ..fields.extent import focus_point
from ..fields.scene import Scene
from ..fields.wide_baseline import is_wide
from ..io.color import to_bytes
from .fit import Photo

PICTURES = 6  # between a photo and its neighbors
NEIGHBORS = 4  # of a camera, among which two are drawn
SIDE = 256  # pixels of a picture at most: the field is no finer


def cameras_between(scene: Scene, cameras: Sequence[Camera], seed: int) -> list[Camera]:
    """Cameras between those of the photos, where these stand far apart; else none.

    For each there are PICTURES, at random places among it and two of its neighbors. They look at what it looks at, and
    are turned with the direction from there.

    Args:
        scene: As learned.
        cameras: Pinholes of the photos.
        seed: Of the places.
    """
    focus = focus_point(list(cameras))
    if scene.background_kind != "opaque" or not is_wide(list(cameras), focus):
        return []
    places = np.stack([camera.position for camera in cameras])
    _, neighbors = tree_of(places).query(places, min(NEIGHBORS + 1, len(places)))
    random = np.random.default_rng([seed, 2])
    return list(_between(cameras, places - focus.numpy(), neighbors[:, 1:], focus.numpy(), random))


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


def _between(
    cameras: Sequence[Camera],
    offsets: np.ndarray,
    neighbors: np.ndarray,
    focus: np.ndarray,
    random: np.random.Generator,
) -> Iterator[Camera]:
    distances = np.linalg.norm(offsets, axis=1)
    directions = offsets / distances[:, None]
    for number, camera in enumerate(cameras):
        for _ in range(PICTURES):
            corners = [number, *random.choice(neighbors[number], 2, replace=False)]
            weights = random.dirichlet(np.ones(3))
            turn = _turn(directions[number], weights @ directions[corners])
            pose = camera.camera_to_world.copy()
            pose[:3, :3] = turn @ pose[:3, :3]
            pose[:3, 3] = focus + weights @ distances[corners] * (turn @ directions[number])
            yield replace(camera, camera_to_world=pose)


def _turn(of: np.ndarray, to: np.ndarray) -> np.ndarray:
    """The smallest rotation [3, 3] of one direction to another, of any lengths."""
    return Rotation.align_vectors(to[None], of[None])[0].as_matrix()
