"""Palette weights of pixels by color and position, as in LoCoPalettes.

Two levels (Chao, Klein, Tan, Echevarria, Gingold 2023, after Tan, Echevarria, Gingold 2018): a pixel is a convex
combination of the corners of its simplex in color and position (RGBXY); each corner has `star_weights`. Nearby pixels
of similar color get similar weights. LoCoPalettes adds corners where a semantic network's features are extreme; here
these are the field's prior features.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from .barycentric_weights import star_weights

DIMENSIONS = 5  # three of color, two of position
FLAT = 1e-3  # extent, in colors or picture sizes, of flat point sets
CHUNK = 65536


def loco_weights(
    colors: np.ndarray, places: np.ndarray, palette: np.ndarray, features: np.ndarray | None = None
) -> np.ndarray:
    """Return the palette weights of pixels by color and position.

    weights @ palette is the color if the colors are in the palette's hull. Pixels without extent in some direction,
    which have no simplices, get `star_weights`.

    Args:
        colors: [n, 3] sRGB in [0, 1].
        places: [n, 2] pixel coordinates in picture sizes.
        palette: [M, 3] sRGB in [0, 1], entry 0 black.
        features: [n, F] prior features of any scale; extreme pixels become corners too.

    Returns:
        [n, M] float32 >= 0; rows sum to 1.

    Examples:
        >>> colors = np.array([[0.5, 0.0, 0.0]])
        >>> loco_weights(colors, np.array([[0.2, 0.3]]), np.array([[0.0, 0, 0], [1, 0, 0]])).tolist()
        [[0.5, 0.5]]
    """
    direct = star_weights(colors, palette)
    points = np.concatenate([colors, places], 1).astype(np.float64)
    corners = hull_corners(points)
    if corners is None:
        return direct
    if features is not None:
        extremes = hull_corners(_principal(np.concatenate([points, features], 1)))
        corners = np.union1d(corners, [] if extremes is None else extremes).astype(int)
    tessellation = Delaunay(points[corners], qhull_options="QJ Pp")
    weights = direct.copy()  # remains for pixels outside by rounding
    for start in range(0, len(points), CHUNK):
        rows, simplices, coordinates = _barycentric(tessellation, points[start : start + CHUNK])
        weights[start + rows] = np.einsum("pv,pvm->pm", coordinates, direct[corners[simplices]])
    return weights / weights.sum(1, keepdims=True)


def hull_corners(points: np.ndarray) -> np.ndarray | None:
    """Return the sorted indices of the corners of the convex hull of points [n, d]; None if they are flat.

    Examples:
        >>> hull_corners(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]])).tolist()
        [0, 1, 2, 3]
        >>> hull_corners(np.zeros((9, 2))) is None
        True
    """
    if len(points) <= points.shape[1] or np.linalg.svd(points - points.mean(0), compute_uv=False)[-1] < FLAT:
        return None
    try:
        return np.sort(ConvexHull(points, qhull_options="Qx Pp").vertices)
    except QhullError:
        return None


def _principal(points: np.ndarray) -> np.ndarray:
    """Return the first DIMENSIONS principal components [n, 5] of points [n, d], channels scaled to unit deviation."""
    centered = points - points.mean(0)
    centered /= np.maximum(centered.std(0), 1e-9)
    axes = np.linalg.eigh(centered.T @ centered)[1][:, ::-1]
    return centered @ axes[:, :DIMENSIONS]


def _barycentric(tessellation: Delaunay, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the points [n, d] inside a simplex: their rows [p], corners [p, d + 1] and barycentric coordinates [p, d +
    1].
    """
    simplex = tessellation.find_simplex(points)
    rows = np.flatnonzero(simplex >= 0)
    transform = tessellation.transform[simplex[rows]]
    shares = np.einsum("pij,pj->pi", transform[:, :-1], points[rows] - transform[:, -1])
    shares = np.concatenate([shares, 1 - shares.sum(1, keepdims=True)], 1)
    regular = np.isfinite(shares).all(1)
    shares = np.maximum(shares[regular], 0)
    return rows[regular], tessellation.simplices[simplex[rows[regular]]], shares / shares.sum(1, keepdims=True)
