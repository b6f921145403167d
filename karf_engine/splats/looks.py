"""Which Gaussians the photos show, and from where. What none shows is guesswork, and is drawn as unsure.

A surface is known from where photos look at it and some way around; from behind, or where nothing constrained it, a
Gaussian shows whatever it happens to hold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..capture.camera import Camera
from .gaussians import Gaussians
from .rasterizer import splatted

SIDE = 256  # pixels, to which photos are reduced
VISIBLE = 0.05  # pixels that a Gaussian must fill there, by what it is blended with: less hardly moves it
ENOUGH = 2.0  # photos that must show it: what only one shows is guesswork too
KNOWN, UNKNOWN = np.radians(10), np.radians(40)  # beyond the photo that looks at it most from aside


def looks_at(gaussians: Gaussians, cameras: Sequence[Camera], step: Callable[[], None] = lambda: None) -> np.ndarray:
    """How cameras look at Gaussians.

    Args:
        gaussians: As learned.
        cameras: Of the photos.
        step: Called after each camera; may raise Cancelled.

    Returns:
        `Gaussians.looks`.
    """
    centers, shown = gaussians.table[:, :3], []
    for camera in cameras:
        shown.append(splatted(gaussians, camera.without_distortion().reduced(SIDE)).weights() >= VISIBLE)
        step()
    eyes = [camera.position for camera in cameras]
    middle = sum(is_shown[:, None] * _directions(centers, eye) for is_shown, eye in zip(shown, eyes, strict=True))
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-6)
    widest = np.zeros(len(centers), np.float32)
    for is_shown, eye in zip(shown, eyes, strict=True):
        widest = np.maximum(widest, np.where(is_shown, _angles(middle, _directions(centers, eye)), 0))
    return np.column_stack([middle, widest, np.sum(shown, axis=0)]).astype(np.float32)


def sureness(gaussians: Gaussians, eye: np.ndarray) -> np.ndarray:
    """How well photos know what each Gaussian looks like from a place.

    Args:
        gaussians: With their looks.
        eye: [3], world.

    Returns:
        [n] float32 in [0, 1]: 1 where two photos show it, and the place is at most KNOWN beyond the farthest of these from their
        middle; 0 where no photo shows it, or from UNKNOWN beyond. What is behind the scene counts as known: it goes on smoothly
        from what photos show of it.
    """
    middle, widest, count = np.split(gaussians.looks, (3, 4), axis=1)
    beyond = _angles(middle, _directions(gaussians.table[:, :3], eye)) - widest[:, 0]
    known = np.clip((UNKNOWN - beyond) / (UNKNOWN - KNOWN), 0, 1) * np.minimum(count[:, 0] / ENOUGH, 1)
    known[gaussians.n_solid :] = 1
    return (known * known * (3 - 2 * known)).astype(np.float32)  # no seam where it begins and ends


def _directions(centers: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Unit vectors [n, 3] from centers to a place."""
    away = np.asarray(eye, np.float32) - centers
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def _angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Radians [n] between unit vectors [n, 3]."""
    return np.arccos(np.clip(np.einsum("nc,nc->n", one, other), -1, 1))
