"""Convert radial lens models to the fisheye and rational models of the module `distortion` (numpy only).

All models map the angle to the optical axis to a distance from the principal point, which a polynomial or a rational function
fits.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..errors import DataError
from .distortion import RAD_TAN_KEYS
from .reader_utils import opencv_distortion

SAMPLES = 400  # angles of the fit
FEWEST = 8  # samples that the lens must map
LARGEST_ANGLE = np.radians(85)  # of rays that a pinhole view can have
GOOD_ERROR, LARGEST_ERROR = 2e-5, 5e-4  # of the distance, focal lengths: 0.04 and 1 pixel of a focal length of 2000


def corner_distance(width: int, height: int, cx: float, cy: float, focal: float) -> float:
    """Return the distance of a photo's farthest corner from the principal point, in focal lengths; 0 for none."""
    return math.hypot(max(cx, width - cx), max(cy, height - cy)) / focal if focal > 0 else 0.0


def fit_fisheye(
    label: str, distance: Callable[[np.ndarray], np.ndarray], largest_distance: float
) -> tuple[float, tuple[float, ...]]:
    """Fit a fisheye model to a radial lens by least squares over a photo: OpenCV's, or one with more terms if that is too far.

    Args:
        label: Names the lens in messages.
        distance: The distance from the principal point, in focal lengths, of rays at angles [n] to the axis, radians;
            nan beyond the lens's field.
        largest_distance: That of the photo's farthest corner.

    Returns:
        The factor of the focal length, and the fisheye model's coefficients.

    Raises:
        DataError: The lens maps no rays, or not in the order of their angles, or the model cannot describe it.
    """
    angles, distances = _samples(label, distance, largest_distance)
    for count in (4, 6):
        powers = np.stack([angles ** (2 * n + 1) for n in range(count + 1)], 1)
        (factor, *coefficients), *_ = np.linalg.lstsq(powers, distances, rcond=None)
        error = np.abs(powers @ [factor, *coefficients] - distances).max() / min(1.0, distances[-1])
        if error <= GOOD_ERROR:
            break
    _check_fit(label, error)
    distortion = [float(value / factor) for value in coefficients]
    return float(factor), tuple(distortion if count == 4 else distortion + [0.0] * (len(RAD_TAN_KEYS) - count))


def brown_distortion(
    label: str, radial: tuple[float, float, float, float], tangential: tuple[float, float], largest_distance: float
) -> tuple[float, ...]:
    """Return OpenCV's perspective distortion for Brown's model with k1..k4 and p1, p2.

    A k4 other than 0 is fitted by the rational model k1..k6 over a photo, as by `fit_fisheye`.
    """
    (k1, k2, k3, k4), (p1, p2) = radial, tangential
    if not k4:
        return opencv_distortion({"k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3}, False)
    angles, distances = _samples(label, lambda angles: _brown(np.tan(angles), radial), largest_distance)
    r = np.tan(angles)
    powers = np.stack([r**2, r**4, r**6], 1)
    factor = distances / r
    # numerator - factor * (denominator - 1) = factor, both without their constant 1
    found, *_ = np.linalg.lstsq(np.hstack([powers, -powers * factor[:, None]]) * r[:, None], distances - r, rcond=None)
    numerator, denominator = 1 + powers @ found[:3], 1 + powers @ found[3:]
    _check_fit(label, np.abs(r * numerator / denominator - distances).max() if denominator.min() > 0 else np.inf)
    k1, k2, k3, k4, k5, k6 = map(float, found)
    return k1, k2, p1, p2, k3, k4, k5, k6


def _brown(r: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    return r * (1 + sum(k * r ** (2 * n + 2) for n, k in enumerate(coefficients)))


def _samples(
    label: str, distance: Callable[[np.ndarray], np.ndarray], largest_distance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return angles within the photo and their distances, both [n] and rising."""
    angles = np.linspace(0, LARGEST_ANGLE, SAMPLES + 1)
    with np.errstate(all="ignore"):
        distances = np.append(0.0, distance(angles[1:]))
        is_rising = np.diff(distances) > 0  # False for nan
        ends = np.flatnonzero(~(is_rising & (distances[1:] <= largest_distance)))
    count = ends[0] if len(ends) else SAMPLES
    if count < FEWEST:
        raise DataError(f"{label} has a lens whose coefficients cannot be.", "Export the cameras again.")
    return angles[1 : count + 1], distances[1 : count + 1]


def _check_fit(label: str, error: float) -> None:
    if not error <= LARGEST_ERROR:
        raise DataError(f"{label} has too strong a lens to be converted.", "Undistort the photos in the other program.")


def division(k: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the distance of the division model (Fitzgibbon 2001): r_undistorted = r / (1 + k r^2)."""

    def distance(angles: np.ndarray) -> np.ndarray:
        tangent = np.tan(angles)
        root = 1 - 4 * k * tangent**2
        return np.where(root >= 0, 2 * tangent / (1 + np.sqrt(np.maximum(root, 0))), np.nan)

    return distance


def field_of_view(omega: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the distance of the FOV model (Devernay and Faugeras 2001)."""
    if abs(omega) < 1e-6:
        return np.tan
    return lambda angles: np.arctan(2 * np.tan(angles) * np.tan(omega / 2)) / omega


def unified(alpha: float, beta: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return the distance of the enhanced unified camera model (Khomutenko et al. 2016)."""

    def distance(angles: np.ndarray) -> np.ndarray:
        sine, cosine = np.sin(angles), np.cos(angles)
        return sine / (alpha * np.sqrt(beta * sine**2 + cosine**2) + (1 - alpha) * cosine)

    return distance


def polynomial(coefficients: tuple[float, ...]) -> Callable[[np.ndarray], np.ndarray]:
    """Return the distance of a fisheye polynomial of any length: angle (1 + k1 angle^2 + k2 angle^4 + ...)."""
    return lambda angles: angles * (1 + sum(k * angles ** (2 * n + 2) for n, k in enumerate(coefficients)))
