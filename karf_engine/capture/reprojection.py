"""Reprojection errors of sparse points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import DataError
from .camera import Camera
from .capture import Capture, SparsePoints
from .distortion import distort

LENS_STEP = 0.5  # half step of central differences, pixels
NEWTON_STEPS = 3


@dataclass(frozen=True)
class ErrorSummary:
    """Reprojection errors of one view.

    Attributes:
        count: Number of observed points.
        median: Median distance, pixels of the photo as stored.
        worst: Largest distance; infinite for a point behind the camera.
    """

    count: int
    median: float
    worst: float

    def __str__(self) -> str:
        return f"{self.count} points, median error {self.median:.2f} px, worst {self.worst:.2f} px"


def reprojection_errors(capture: Capture, view_number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return observed and projected pixels of the sparse points of a view. Raises DataError if the capture has none.

    Returns:
        Observed [m, 2] and projected [m, 2] float64, in pixels of the photo as stored and in the order of the
        observations; nan for points behind the camera or outside the valid radius of its lens.
    """
    camera, points = capture.views[view_number].camera, _points(capture)
    pixels, depth = camera.project(observed_points(capture, view_number))
    pixels[depth <= 0] = np.nan
    return points.pixels[points.view == view_number].astype(np.float64), distort(camera, pixels)


def observed_points(capture: Capture, view_number: int) -> np.ndarray:
    """Return the world positions [m, 3] float64 of the points that a view observed. Raises DataError without points."""
    points = _points(capture)
    return points.positions[points.point[points.view == view_number]]


def _points(capture: Capture) -> SparsePoints:
    if capture.points is None:
        raise DataError(f"{capture.source} has no sparse points.", "Only captures with a COLMAP model have them.")
    return capture.points


def summarize(observed: np.ndarray, projected: np.ndarray) -> ErrorSummary:
    """Summarize the distances between pixels [m, 2] and [m, 2]; zeros if there are none."""
    errors = np.nan_to_num(np.linalg.norm(observed - projected, axis=-1), nan=np.inf)
    if not len(errors):
        return ErrorSummary(0, 0.0, 0.0)
    return ErrorSummary(len(errors), float(np.median(errors)), float(errors.max()))


def undistort_points_near(camera: Camera, pixels: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Map pixels [m, 2] of the photo as stored to undistorted pixels, float64, from the guess `near` [m, 2].

    Takes a fixed number of Newton steps, unlike `undistort_points`.
    """
    if camera.is_pinhole:
        return np.asarray(pixels, np.float64)
    du, dv = np.array([LENS_STEP, 0.0]), np.array([0.0, LENS_STEP])
    for _ in range(NEWTON_STEPS):
        a, c = (distort(camera, near + du) - distort(camera, near - du)).T
        b, d = (distort(camera, near + dv) - distort(camera, near - dv)).T
        u, v = (pixels - distort(camera, near)).T * (2 * LENS_STEP)
        near = near + np.stack([d * u - b * v, a * v - c * u], -1) / (a * d - b * c)[:, None]
    return near
