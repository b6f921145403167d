"""Visibility of Gaussians in the photos, and the confidence in their appearance from other viewpoints.

A surface is known from the photos' directions and somewhat beyond. From elsewhere a Gaussian's color is unconstrained.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..capture.camera import Camera
from .gaussians import Gaussians
from .rasterizer import rasterize

SIDE = 256  # pixels of the reduced photos
VISIBLE = 0.05  # pixels that a Gaussian must cover there, as the sum of its blending weights
ENOUGH = 2.0  # photos needed for full confidence
KNOWN, UNKNOWN = np.radians(10), np.radians(40)  # angles beyond the outermost photo of full and of no confidence


def visibility_in_photos(
    gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None
) -> np.ndarray:
    """Compute `Gaussians.visibility` for the photos' cameras. step: called after each; may raise Cancelled."""
    centers, shown = gaussians.table[:, :3], []
    for camera in cameras:
        shown.append(rasterize(gaussians, camera.without_distortion().reduced(SIDE)).weights() >= VISIBLE)
        step()
    eyes = [camera.position for camera in cameras]
    middle = sum(is_shown[:, None] * _directions(centers, eye) for is_shown, eye in zip(shown, eyes, strict=True))
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-6)
    widest = np.zeros(len(centers), np.float32)
    for is_shown, eye in zip(shown, eyes, strict=True):
        widest = np.maximum(widest, np.where(is_shown, _angles(middle, _directions(centers, eye)), 0))
    return np.column_stack([middle, widest, np.sum(shown, axis=0)]).astype(np.float32)


def confidence_from(gaussians: Gaussians, eye: np.ndarray) -> np.ndarray:
    """Return the confidence in each Gaussian's appearance from a viewpoint.

    Args:
        gaussians: With `visibility`.
        eye: [3], world.

    Returns:
        [n] float32 in [0, 1]: 1 if at least ENOUGH photos show it and the viewpoint is at most KNOWN beyond them,
        0 from UNKNOWN beyond them or if no photo shows it. 1 for the background.
    """
    assert gaussians.visibility is not None
    middle, widest, count = np.split(gaussians.visibility, (3, 4), axis=1)
    beyond = _angles(middle, _directions(gaussians.table[:, :3], eye)) - widest[:, 0]
    known = np.clip((UNKNOWN - beyond) / (UNKNOWN - KNOWN), 0, 1) * np.minimum(count[:, 0] / ENOUGH, 1)
    known[gaussians.n_foreground :] = 1
    return (known * known * (3 - 2 * known)).astype(np.float32)  # smoothstep: no visible seam


def _directions(centers: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return unit vectors [n, 3] from centers to a viewpoint."""
    away = np.asarray(eye, np.float32) - centers
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def _angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return angles [n] between unit vectors [n, 3], radians."""
    return np.arccos(np.clip(np.einsum("nc,nc->n", one, other), -1, 1))
