"""Palette weights of colors: barycentric in the `star` tessellation, or by color and position as in LoCoPalettes.

Palettes are [M, 3] sRGB in [0, 1] with black as entry 0, possibly flat or of a single hue.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from .star import Hull, Star, star_of, star_weights_in, to_hull

DIMENSIONS = 5  # three of color, two of position
FLAT = 1e-3  # extent, in colors or picture sizes, of flat point sets
CHUNK = 65536


def star_weights(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the barycentric weights [n, M] float32 of colors, sRGB [n, 3], in a palette's star tessellation.

    weights @ palette is the color, or its projection to the hull. Rows sum to 1 and have at most 4 nonzeros. Weights
    are continuous and depend on the color alone, so they are equal in every view; entries inside the hull of the others
    get none.
    """
    return star_weights_in(_star(palette), colors, len(palette))


def palette_weights_of_image(image: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the `star_weights` [H, W, M] of a uint8 picture [H, W, 3], evaluated once per distinct color."""
    packed = image.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
    unique, inverse = np.unique(packed, return_inverse=True)
    colors = np.stack([unique >> 16, unique >> 8 & 255, unique & 255], axis=-1) / 255
    return star_weights(colors, palette)[inverse].reshape(*image.shape[:2], len(palette))


def outside_distance(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the distance [n] of colors, sRGB [n, 3], to the hull of a palette [M, 3]; 0 inside."""
    colors = np.asarray(colors, np.float64)
    star = _star(palette)
    if star is None:
        return np.linalg.norm(colors, axis=1)
    local = colors @ star.span
    off_span = ((colors - local @ star.span.T) ** 2).sum(axis=1)
    return np.sqrt(off_span + to_hull(star, local)[1])


def _star(palette: np.ndarray) -> Star | None:
    return star_of(palette, _hull)


def _hull(points: np.ndarray) -> Hull:
    hull = ConvexHull(points)
    return hull.simplices, hull.equations[:, :-1], hull.equations[:, -1]


def loco_weights(
    colors: np.ndarray, places: np.ndarray, palette: np.ndarray, features: np.ndarray | None = None
) -> np.ndarray:
    """Return the palette weights of n pixels by color and position, [n, M] float32 >= 0; rows sum to 1.

    Two levels (Chao, Klein, Tan, Echevarria, Gingold 2023, after Tan, Echevarria, Gingold 2018): a pixel is a convex
    combination of the corners of its simplex in color and position (RGBXY), and each corner has `star_weights`.

    Colors are sRGB [n, 3]; places [n, 2] are pixel coordinates in picture sizes. Pixels of extreme `features` [n, F] of
    any scale become corners too.
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
    """Return the sorted indices of the corners of the convex hull of points [n, d]; None if they are flat."""
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
    """Return the points [n, d] inside a simplex: rows [p], corners [p, d + 1], barycentric coordinates [p, d + 1]."""
    simplex = tessellation.find_simplex(points)
    rows = np.flatnonzero(simplex >= 0)
    transform = tessellation.transform[simplex[rows]]
    shares = np.einsum("pij,pj->pi", transform[:, :-1], points[rows] - transform[:, -1])
    shares = np.concatenate([shares, 1 - shares.sum(1, keepdims=True)], 1)
    regular = np.isfinite(shares).all(1)
    shares = np.maximum(shares[regular], 0)
    return rows[regular], tessellation.simplices[simplex[rows[regular]]], shares / shares.sum(1, keepdims=True)
