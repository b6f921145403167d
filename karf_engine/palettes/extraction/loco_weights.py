"""Palette weights of an object's pixels in one photo, as LoCoPalettes has them: by place as well as by color.

Two levels (Chao, Klein, Tan, Echevarria, Gingold 2023, after Tan, Echevarria, Gingold 2018).

First a pixel is a mix of a few pixels, corners of a simplex in color and place (RGBXY); then each of these is a mix of
the palette (`star_weights`). Nearby pixels of like color get like weights; the same color elsewhere may get others.
LoCoPalettes adds corners where a semantic network's features stand out; here these are the field's prior features.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from .barycentric_weights import star_weights

DIMENSIONS = 5  # three of color and two of place
FLAT = 1e-3  # extent of pixels, in colors or picture sizes, below which they have no thickness in a direction
CHUNK = 65536


def loco_weights(
    colors: np.ndarray, places: np.ndarray, palette: np.ndarray, features: np.ndarray | None = None
) -> np.ndarray:
    """Weights of each pixel over the palette.

    weights @ palette is the color where the pixels' colors lie in the palette's hull. Pixels without extent in some
    direction of color and place, which have no simplices, get `star_weights`.

    Args:
        colors: [n, 3] sRGB in [0, 1].
        places: [n, 2] pixel coordinates in picture sizes.
        palette: [M, 3] sRGB in [0, 1], entry 0 black.
        features: [n, F] prior features, of any scale; pixels where they stand out become corners too.

    Returns:
        [n, M] float32 >= 0; rows sum to 1.

    Example:
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
        standing_out = hull_corners(_principal(np.concatenate([points, features], 1)))
        corners = np.union1d(corners, [] if standing_out is None else standing_out).astype(int)
    tessellation = Delaunay(points[corners], qhull_options="QJ Pp")
    weights = direct.copy()  # of the few pixels that rounding puts outside
    for start in range(0, len(points), CHUNK):
        rows, simplices, mixes = _mixes(tessellation, points[start : start + CHUNK])
        weights[start + rows] = np.einsum("pv,pvm->pm", mixes, direct[corners[simplices]])
    return weights / weights.sum(1, keepdims=True)


def hull_corners(points: np.ndarray) -> np.ndarray | None:
    """The corners of the convex hull of points.

    Args:
        points: [n, d].

    Returns:
        Their indices, ascending; None where the points are too flat to have a hull.

    Example:
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
    """The first DIMENSIONS principal components [n, 5] of points [n, d], each channel scaled to unit deviation."""
    centered = points - points.mean(0)
    centered /= np.maximum(centered.std(0), 1e-9)
    axes = np.linalg.eigh(centered.T @ centered)[1][:, ::-1]
    return centered @ axes[:, :DIMENSIONS]


def _mixes(tessellation: Delaunay, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the points [n, d] in a simplex: their rows [p], its corners [p, d + 1] and their shares [p, d + 1]."""
    simplex = tessellation.find_simplex(points)
    rows = np.flatnonzero(simplex >= 0)
    transform = tessellation.transform[simplex[rows]]
    shares = np.einsum("pij,pj->pi", transform[:, :-1], points[rows] - transform[:, -1])
    shares = np.concatenate([shares, 1 - shares.sum(1, keepdims=True)], 1)
    regular = np.isfinite(shares).all(1)
    shares = np.maximum(shares[regular], 0)
    return rows[regular], tessellation.simplices[simplex[rows[regular]]], shares / shares.sum(1, keepdims=True)
