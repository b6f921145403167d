"""OpenCV's perspective and fisheye lens distortion in numpy, of points and of photos for Blender's backgrounds.

With x, y the pinhole's normalized coordinates (x right, y down, depth 1) and r^2 = x^2 + y^2 (OpenCV documentation,
calib3d and fisheye; src/colmap/sensor/models.h)::

    perspective   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
                  y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
    fisheye       a = atan(r),  (x', y') = (x, y) / r * (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9)

COLMAP's fisheye models with a thin prism add to (x', y'), with u, v, q^2 = u^2 + v^2::

    2 p1 u v + p2 (q^2 + 2 u^2) + s1 q^2 + s2 q^4,  p1 (q^2 + 2 v^2) + 2 p2 u v + s3 q^2 + s4 q^4

THIN_PRISM_FISHEYE takes (u, v) = (x, y) / r * a, without s2 and s4; RAD_TAN_THIN_PRISM_FISHEYE takes (u, v) = (x', y'), and
continues the polynomial by k5 a^11 + k6 a^13.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .camera import Camera

NEWTON_STEPS = 25
GRADIENT_STEP = 1e-3  # step of difference quotients, pixels
TOLERANCE = 1e-4  # final residual of the inversion, pixels
LENS_STEP = 0.5  # half step of central differences, pixels
NEAR_STEPS = 3  # Newton steps from a near guess
# coefficients of fisheye models in the order of `Camera.distortion`
FISHEYE_KEYS = ("k1", "k2", "k3", "k4")
THIN_PRISM_KEYS = (*FISHEYE_KEYS, "p1", "p2", "s1", "s2", "s3", "s4")
RAD_TAN_KEYS = (*FISHEYE_KEYS, "k5", "k6", "p1", "p2", "s1", "s2", "s3", "s4")
BLOCK_ROWS = 16  # rows undistorted at a time, so that intermediate results fit the CPU cache


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


def undistort_points_near(camera: Camera, pixels: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Map pixels [m, 2] of the photo as stored to undistorted pixels, float64, from the guess `near` [m, 2].

    Takes a fixed number of Newton steps, unlike `undistort_points`.
    """
    if camera.is_pinhole:
        return np.asarray(pixels, np.float64)
    du, dv = np.array([LENS_STEP, 0.0]), np.array([0.0, LENS_STEP])
    for _ in range(NEAR_STEPS):
        a, c = (distort(camera, near + du) - distort(camera, near - du)).T
        b, d = (distort(camera, near + dv) - distort(camera, near - dv)).T
        u, v = (pixels - distort(camera, near)).T * (2 * LENS_STEP)
        near = near + np.stack([d * u - b * v, a * v - c * u], -1) / (a * d - b * c)[:, None]
    return near


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
    is_radial_first = len(distortion) == len(RAD_TAN_KEYS)
    radial, prism = (distortion[:6], distortion[6:]) if is_radial_first else (distortion[:4], distortion[4:])
    radius = np.linalg.norm(plane, axis=-1, keepdims=True)
    angle = np.arctan(radius)
    a2 = angle * angle
    distorted = angle * _polynomial((1, *radial), a2)
    is_valid = _polynomial([(2 * n + 1) * k for n, k in enumerate((1, *radial))], a2) > 0
    factor = np.where(radius > 1e-8, distorted / np.maximum(radius, 1e-8), 1.0)  # the limit at the center is 1
    result = plane * np.where(is_valid, factor, np.nan)
    if not any(prism):
        return result
    return result + _prism(result if is_radial_first else plane * (angle / np.maximum(radius, 1e-8)), prism)


def _polynomial(coefficients: Sequence[float], x: np.ndarray) -> np.ndarray | float:
    """Evaluate c0 + c1 x + c2 x^2 + ..."""
    total: np.ndarray | float = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = coefficient + x * total
    return total


def _prism(plane: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    p1, p2, s1, s2, s3, s4 = coefficients
    u, v = plane[..., 0], plane[..., 1]
    q2 = u * u + v * v
    du = 2 * p1 * u * v + p2 * (q2 + 2 * u * u) + q2 * (s1 + q2 * s2)
    dv = p1 * (q2 + 2 * v * v) + 2 * p2 * u * v + q2 * (s3 + q2 * s4)
    return np.stack([du, dv], -1)


# --------------------------------------------------------------------------------------------------------------- photos
def undistorted(photo: np.ndarray, camera: Camera) -> np.ndarray:
    """Undistort a photo as stored, float32 [H, W, C], with bilinear interpolation; black outside the photo.

    The pixels are those of `training_images.undistort`.
    """
    photo = np.ascontiguousarray(photo)
    result = np.empty_like(photo)
    columns = np.arange(camera.width) + 0.5
    for top in range(0, camera.height, BLOCK_ROWS):
        rows = np.arange(top, min(top + BLOCK_ROWS, camera.height)) + 0.5
        positions = distort(camera, np.stack(np.meshgrid(columns, rows), -1))
        is_inside = (positions >= 0) & (positions <= (camera.width, camera.height))  # False for nan
        inside = np.all(is_inside, axis=-1)
        result[top : top + BLOCK_ROWS] = _bilinear(photo, np.where(inside[..., None], positions - 0.5, 0))
        result[top : top + BLOCK_ROWS][~inside] = 0
    return result


def _bilinear(photo: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Sample an image at (column, row) positions [..., 2], clamped to the outer pixel centers; [..., C]."""
    height, width, channels = photo.shape
    pixels = photo.reshape(-1, channels)
    column, row = np.clip(positions[..., 0], 0, width - 1), np.clip(positions[..., 1], 0, height - 1)
    left, top = column.astype(np.intp), row.astype(np.intp)
    fraction_u = (column - left).astype(np.float32)[..., None]
    fraction_v = (row - top).astype(np.float32)[..., None]
    right, below = (left < width - 1).astype(np.intp), (top < height - 1) * width  # index offsets of the neighbors
    corner = top * width + left
    upper = _lerp(pixels.take(corner, 0), pixels.take(corner + right, 0), fraction_u)
    lower = _lerp(pixels.take(corner + below, 0), pixels.take(corner + below + right, 0), fraction_u)
    return _lerp(upper, lower, fraction_v)


def _lerp(first: np.ndarray, second: np.ndarray, weight: np.ndarray) -> np.ndarray:
    return first + (second - first) * weight
