"""Interpolation of posed pictures: the recolor of one photo is carried into other views by depth, without palettes.

The painter has recolored the whole reference photo, which is more than the one color pair that all others know. What
the recolor changes there is looked up where a pixel's surface is seen in the reference view; where it is hidden, the
change of the reference's pixels of most similar colors is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from karf_engine.capture.camera import Camera
from karf_engine.compute.neighbors import build_kd_tree
from karf_engine.recolor.frames import Frame

DEPTH_TOLERANCE = 0.02  # relative difference of depth up to which two views see the same surface
ALIKE = 8  # nearest colors whose changes are averaged
LEAST = 1 / 512  # probability below which a pixel stays


@dataclass(frozen=True)
class Painted:
    """A view whose recolor is known: its pinhole, its frame with the photo as base, and the change [H, W, 3]."""

    camera: Camera
    frame: Frame
    change: np.ndarray


def carried_over(reference: Painted, camera: Camera, frame: Frame, number: int) -> np.ndarray:
    """How one object's pixels of another view change, [H, W, 3]: by its probability there, 0 where it is not.

    Args:
        reference: The painted view.
        camera: Of the other view.
        frame: Of the other view, the photo its base.
        number: Of the object.
    """
    probability, own = frame.probabilities[number], reference.frame.masks[number]
    change = np.zeros(frame.base.shape)
    shown = probability > LEAST
    if not own.any() or not shown.any():
        return change
    pixels, is_seen = seen_in(reference, camera, frame.depth, own)
    carried = np.stack([_looked_up(channel, pixels) for channel in np.moveaxis(reference.change, 2, 0)], -1)
    carried[~is_seen] = _of_alike(reference.frame.base[own], reference.change[own], frame.base.reshape(-1, 3)[~is_seen])
    change[shown] = (probability[..., None] * carried.reshape(change.shape))[shown]
    return change


def seen_in(reference: Painted, camera: Camera, depth: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the surface of each pixel lies in the reference view, [H * W, 2], and whether it is seen there as the object.

    Args:
        reference: The painted view.
        camera: Of the pixels.
        depth: Of the pixels along the optical axis, [H, W], world units.
        own: The object in the reference view, bool [h, w].
    """
    origins, directions = camera.rays(camera.pixel_centers())
    pixels, distance = reference.camera.project(origins + depth.reshape(-1, 1) * directions)
    front = np.maximum(distance, 1e-9)
    height, width = own.shape
    within = (distance > 0) & (pixels >= 0).all(1) & (pixels < (width, height)).all(1)
    surface = _looked_up(reference.frame.depth, pixels, order=0)
    is_object = _looked_up(own.astype(np.float64), pixels, order=0) > 0.5
    return pixels, within & is_object & (np.abs(surface - front) < DEPTH_TOLERANCE * front)


def _looked_up(picture: np.ndarray, pixels: np.ndarray, order: int = 1) -> np.ndarray:
    """A picture [h, w] at pixel positions [n, 2] (u, v), centers at +0.5."""
    return map_coordinates(picture, np.nan_to_num(pixels[:, ::-1].T - 0.5), order=order, mode="nearest")


def _of_alike(colors: np.ndarray, changes: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Mean change [n, 3] of the colors [m, 3] nearest to each wanted one [n, 3]."""
    count = min(ALIKE, len(colors))
    _, nearest = build_kd_tree(colors, balanced_tree=False, compact_nodes=False).query(wanted, k=range(1, count + 1))
    return changes[nearest].mean(1)
