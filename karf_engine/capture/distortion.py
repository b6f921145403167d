"""Where a photo's lens puts what a pinhole shows: OpenCV's two lens models in numpy.

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
SLOPE_STEP = 1e-3  # step of difference quotients, pixels
NEAR_ENOUGH = 1e-4  # residual at which the inversion stops, pixels


def distort(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Where the photo, as stored, shows what the camera's pinhole shows.

    Args:
        camera: With its distortion.
        pixels: Positions in the pinhole's picture, [.., 2].

    Returns:
        Positions in the photo, [.., 2] float64; nan where radii no longer grow, since the polynomials fold the picture
        over there.
    """
    if camera.is_pinhole:
        return np.asarray(pixels, np.float64)
    center, focal = np.array([camera.cx, camera.cy]), np.array([camera.fx, camera.fy])
    plane = (np.asarray(pixels, np.float64) - center) / focal
    bent = _fisheye(plane, camera.distortion) if camera.fisheye else _perspective(plane, camera.distortion)
    return center + focal * bent


def straighten(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Where the camera's pinhole shows what the photo, as stored, shows: the inverse of `distort`, by Newton's method.

    Args:
        camera: With its distortion.
        pixels: Positions in the photo, [n, 2].

    Returns:
        Positions in the pinhole's picture, [n, 2] float64; nan where the lens shows nothing there.
    """
    pixels = np.asarray(pixels, np.float64)
    if camera.is_pinhole:
        return pixels
    center, found, left = np.array([camera.cx, camera.cy]), pixels.copy(), np.arange(len(pixels))
    for _ in range(NEWTON_STEPS):
        seen = distort(camera, found[left])
        far = ~(np.abs(seen - pixels[left]).max(1) < NEAR_ENOUGH)  # nan is far
        left, seen = left[far], seen[far]
        found[left] += _newton_step(camera, found[left], seen, pixels[left] - seen, center)
    found[left] = np.nan
    return found


def _newton_step(
    camera: Camera, found: np.ndarray, seen: np.ndarray, error: np.ndarray, center: np.ndarray
) -> np.ndarray:
    across, down = ((distort(camera, found + step) - seen) / SLOPE_STEP for step in np.eye(2) * SLOPE_STEP)
    with np.errstate(all="ignore"):
        area = across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]
        u = (error[:, 0] * down[:, 1] - error[:, 1] * down[:, 0]) / area
        v = (error[:, 1] * across[:, 0] - error[:, 0] * across[:, 1]) / area
    step = np.stack([u, v], 1)
    # beyond the radius at which the polynomials fold over: back towards the center
    return np.where(np.isfinite(step).all(1, keepdims=True), step, (center - found) / 4)


def _perspective(plane: np.ndarray, distortion: tuple[float, ...]) -> np.ndarray:
    k1, k2, p1, p2, k3, k4, k5, k6 = (*distortion, *[0.0] * 8)[:8]
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    above, below = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    slope_above = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))  # derivative by r, over r
    slope_below = 2 * (k4 + r2 * (2 * k5 + r2 * 3 * k6))
    grows = (above * below + r2 * (slope_above * below - above * slope_below) > 0) & (below > 0)
    radial = np.where(grows, above / np.where(grows, below, 1), np.nan)
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        -1,
    )


def _fisheye(plane: np.ndarray, distortion: tuple[float, ...]) -> np.ndarray:
    k1, k2, k3, k4 = (*distortion, *[0.0] * 4)[:4]
    radius = np.linalg.norm(plane, axis=-1, keepdims=True)
    angle = np.arctan(radius)
    a2 = angle * angle
    bent = angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    grows = 1 + a2 * (3 * k1 + a2 * (5 * k2 + a2 * (7 * k3 + a2 * 9 * k4))) > 0
    # near the center the quotient is one: no division by nothing
    factor = np.where(radius > 1e-8, bent / np.maximum(radius, 1e-8), 1.0)
    return plane * np.where(grows, factor, np.nan)
