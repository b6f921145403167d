"""OpenCV's perspective and fisheye lens distortion in numpy.

With x, y the pinhole's normalized coordinates (x right, y down, depth 1) and r^2 = x^2 + y^2 (OpenCV documentation,
calib3d and fisheye)::

    perspective   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
                  y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
    fisheye       a = atan(r),  (x', y') = (x, y) / r * (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9)
"""

from __future__ import annotations

import numpy as np

from .camera import Camera

NEWTON_STEPS = 25
GRADIENT_STEP = 1e-3  # step of difference quotients, pixels
TOLERANCE = 1e-4  # final residual of the inversion, pixels


def distort(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Map undistorted pixels [..., 2] to pixels of the photo as stored, float64.

    The result is nan where the distorted radius decreases, that is, the image folds over.
    """
    if camera.is_pinhole:
        return np.asarray(pixels, np.float64)
    center, focal = np.array([camera.cx, camera.cy]), np.array([camera.fx, camera.fy])
    plane = (np.asarray(pixels, np.float64) - center) / focal
    distorted = _fisheye(plane, camera.distortion) if camera.fisheye else _perspective(plane, camera.distortion)
    return center + focal * distorted


def undistort_points(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Map pixels [n, 2] of the photo as stored to undistorted pixels, float64: the inverse of `distort`.

    Uses Newton's method; the result is nan where it does not converge.
    """
    pixels = np.asarray(pixels, np.float64)
    if camera.is_pinhole:
        return pixels
    center, estimate, active = np.array([camera.cx, camera.cy]), pixels.copy(), np.arange(len(pixels))
    for _ in range(NEWTON_STEPS):
        distorted = distort(camera, estimate[active])
        unconverged = ~(np.abs(distorted - pixels[active]).max(1) < TOLERANCE)  # also nan
        active, distorted = active[unconverged], distorted[unconverged]
        estimate[active] += _newton_step(camera, estimate[active], distorted, pixels[active] - distorted, center)
    estimate[active] = np.nan
    return estimate


def _newton_step(
    camera: Camera, estimate: np.ndarray, distorted: np.ndarray, residual: np.ndarray, center: np.ndarray
) -> np.ndarray:
    steps = np.eye(2) * GRADIENT_STEP
    du, dv = ((distort(camera, estimate + step) - distorted) / GRADIENT_STEP for step in steps)
    with np.errstate(all="ignore"):
        determinant = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
        u = (residual[:, 0] * dv[:, 1] - residual[:, 1] * dv[:, 0]) / determinant
        v = (residual[:, 1] * du[:, 0] - residual[:, 0] * du[:, 1]) / determinant
    step = np.stack([u, v], 1)
    # outside the valid radius, move towards the center
    return np.where(np.isfinite(step).all(1, keepdims=True), step, (center - estimate) / 4)


def _perspective(plane: np.ndarray, distortion: tuple[float, ...]) -> np.ndarray:
    k1, k2, p1, p2, k3, k4, k5, k6 = (*distortion, *[0.0] * 8)[:8]
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    numerator, denominator = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    d_numerator = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))  # derivative by r, over r
    d_denominator = 2 * (k4 + r2 * (2 * k5 + r2 * 3 * k6))
    slope = numerator * denominator + r2 * (d_numerator * denominator - numerator * d_denominator)
    is_valid = (slope > 0) & (denominator > 0)
    radial = np.where(is_valid, numerator / np.where(is_valid, denominator, 1), np.nan)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([u, v], -1)


def _fisheye(plane: np.ndarray, distortion: tuple[float, ...]) -> np.ndarray:
    k1, k2, k3, k4 = (*distortion, *[0.0] * 4)[:4]
    radius = np.linalg.norm(plane, axis=-1, keepdims=True)
    angle = np.arctan(radius)
    a2 = angle * angle
    distorted = angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    is_valid = 1 + a2 * (3 * k1 + a2 * (5 * k2 + a2 * (7 * k3 + a2 * 9 * k4))) > 0
    factor = np.where(radius > 1e-8, distorted / np.maximum(radius, 1e-8), 1.0)  # the limit at the center is 1
    return plane * np.where(is_valid, factor, np.nan)
