"""How well cameras, lenses and sparse points agree: where photos show points, and where cameras project them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import DataError
from .camera import Camera
from .capture import Capture
from .distortion import distort

LENS_STEP = 0.5  # pixels to either side over which the slopes of a lens are measured
NEWTON_STEPS = 3


@dataclass(frozen=True)
class ErrorSummary:
    """Reprojection errors of one view.

    Attributes:
        count: How many points it observed.
        median: Distance in pixels of the photo as stored.
        worst: The largest distance; infinite for a point behind the camera.
    """

    count: int
    median: float
    worst: float

    def __str__(self) -> str:
        return f"{self.count} points, median error {self.median:.2f} px, worst {self.worst:.2f} px"


def reprojection_errors(capture: Capture, view_number: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels at which a view's photo, as stored, shows sparse points, and to which its camera and lens project them.

    Args:
        capture: With sparse points.
        view_number: Which of its views.

    Returns:
        Observed [m, 2] and projected [m, 2] float64, in the order of `points.point`; projected is nan for points behind
        the camera or beyond what its lens can show.

    Raises:
        DataError: The capture has no points.
    """
    camera = capture.views[view_number].camera
    pixels, depth = camera.project(observed_points(capture, view_number))
    pixels[depth <= 0] = np.nan
    return capture.points.pixels[capture.points.view == view_number].astype(np.float64), distort(camera, pixels)


def observed_points(capture: Capture, view_number: int) -> np.ndarray:
    """World positions [m, 3] float64 of the sparse points that a view observed.

    Raises:
        DataError: The capture has no points.
    """
    if capture.points is None:
        raise DataError(f"{capture.source} has no sparse points.", "Only captures with a COLMAP model have them.")
    return capture.points.positions[capture.points.point[capture.points.view == view_number]]


def summarize(observed: np.ndarray, projected: np.ndarray) -> ErrorSummary:
    """Number, median and worst of the distances between pixels [m, 2] and [m, 2]; zeros where there are none."""
    errors = np.nan_to_num(np.linalg.norm(observed - projected, axis=-1), nan=np.inf)
    if not len(errors):
        return ErrorSummary(0, 0.0, 0.0)
    return ErrorSummary(len(errors), float(np.median(errors)), float(errors.max()))


def undistorted_near(camera: Camera, pixels: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Where the camera's pinhole shows what its photo shows: the inverse of `distort`, by Newton steps.

    Args:
        camera: With its distortion.
        pixels: Positions in the photo as stored, [m, 2].
        near: Pinhole pixels close to the answer, to start from, [m, 2].

    Returns:
        Positions in the pinhole's picture, [m, 2] float64.
    """
    if camera.is_pinhole:
        return np.asarray(pixels, np.float64)
    across, down = np.array([LENS_STEP, 0.0]), np.array([0.0, LENS_STEP])
    for _ in range(NEWTON_STEPS):
        a, c = (distort(camera, near + across) - distort(camera, near - across)).T
        b, d = (distort(camera, near + down) - distort(camera, near - down)).T
        u, v = (pixels - distort(camera, near)).T * (2 * LENS_STEP)
        near = near + np.stack([d * u - b * v, a * v - c * u], -1) / (a * d - b * c)[:, None]
    return near
