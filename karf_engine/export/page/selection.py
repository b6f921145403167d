"""Which Gaussians of a scene a page shows: those that the photos need, and the background."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...capture.camera import Camera
from ...splats.gaussians import Gaussians
from ...splats.rasterizer import rasterize

SIDE = 256  # pixels of the pictures in which Gaussians are weighed
NEGLIGIBLE = 0.5 / 255  # bound of how much all that are left out change the mean color of a photo, sRGB
COMPARED_VIEWS, COMPARED_SIDE = 6, 400  # pictures that state the loss


@dataclass(frozen=True)
class Visible:
    """The share of the photos that each of n Gaussians fills."""

    most: np.ndarray  # [n], largest share of a photo that each fills, in [0, 1]
    objects: np.ndarray  # [cameras], share of each photo that the Gaussians of interest fill


def measure_visible(
    gaussians: Gaussians, cameras: Sequence[Camera], of_interest: np.ndarray, step: Callable[[], None]
) -> Visible:
    """Weigh the Gaussians in the photos of these cameras. of_interest: [n] bool. step: called after each camera."""
    most, objects = np.zeros(len(gaussians), np.float32), []
    for camera in cameras:
        small = camera.without_distortion().reduced(SIDE)
        shares = rasterize(gaussians, small).weights() / (small.width * small.height)
        most = np.maximum(most, shares)
        objects.append(float(shares[of_interest].sum()))
        step()
    return Visible(most, np.array(objects))


def rows_to_show(gaussians: Gaussians, visible: Visible) -> np.ndarray:
    """Return the rows of the background, and those without which photos would change, sorted."""
    order = np.argsort(visible.most[: gaussians.n_foreground], kind="stable")
    total = np.cumsum(visible.most[order], dtype=np.float64)
    return np.sort(np.append(order[total > NEGLIGIBLE], np.arange(gaussians.n_foreground, len(gaussians))))


def most_visible(rows: np.ndarray, visible: Visible, count: int) -> np.ndarray:
    """Return the most visible of these rows, sorted."""
    return np.sort(rows[np.argsort(-visible.most[rows], kind="stable")[:count]])


def psnr_of(shown: Gaussians, whole: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return the PSNR in dB of Gaussians against the whole scene, over some of the cameras."""
    numbers = np.linspace(0, len(cameras) - 1, min(COMPARED_VIEWS, len(cameras))).astype(int)
    small = [cameras[number].without_distortion().reduced(COMPARED_SIDE) for number in numbers]
    errors = [np.mean((rasterize(shown, c).picture() - rasterize(whole, c).picture()) ** 2) for c in small]
    return float(-10 * np.log10(max(np.mean(errors), 1e-12)))
