"""Convert radial lens models to OpenCV's fisheye model (numpy only).

All models map the angle to the optical axis to a distance from the principal point, which the fisheye polynomial fits.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SAMPLES = 400  # angles of the fit
LARGEST_ANGLE = np.radians(85)  # of rays that a pinhole view can have


def fit_fisheye(
    distance: Callable[[np.ndarray], np.ndarray], largest_distance: float
) -> tuple[float, tuple[float, ...]]:
    """Fit OpenCV's fisheye model to a radial lens by least squares over a photo.

    Args:
        distance: The distance from the principal point, in focal lengths, of rays at angles [n] to the axis, radians;
            nan beyond the lens's field.
        largest_distance: That of the photo's farthest corner.

    Returns:
        The factor of the focal length, and the coefficients k1..k4.
    """
    angles = np.linspace(0, LARGEST_ANGLE, SAMPLES + 1)[1:]
    distances = distance(angles)
    outside = np.flatnonzero(~(distances <= largest_distance))
    count = max(8, outside[0] if len(outside) else SAMPLES)
    used = np.isfinite(distances[:count])
    angles, distances = angles[:count][used], distances[:count][used]
    powers = np.stack([angles ** (2 * n + 1) for n in range(5)], 1)
    (factor, *coefficients), *_ = np.linalg.lstsq(powers, distances, rcond=None)
    return float(factor), tuple(float(value / factor) for value in coefficients)


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
