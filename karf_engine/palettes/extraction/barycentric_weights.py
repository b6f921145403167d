"""Palette weights of colors: barycentric coordinates in the star tessellation of the palette's hull (`star`).

A color inside the hull is in one cone, and the convex combination of black and the facet's corners. A color outside is
first projected to the hull. The weights depend on the color alone, so they are equal in every view.

Palettes are [M, 3] sRGB in [0, 1] with black as entry 0, possibly flat or of a single hue.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from ..star import Hull, Star, star_of, star_weights_in, to_hull


def _star(palette: np.ndarray) -> Star | None:
    """Build the star tessellation of a palette with scipy's hull."""
    return star_of(palette, _hull)


def _hull(points: np.ndarray) -> Hull:
    hull = ConvexHull(points)
    return hull.simplices, hull.equations[:, :-1], hull.equations[:, -1]


def star_weights(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the barycentric weights [n, M] float32 of colors, sRGB [n, 3], in the star tessellation of a palette.

    weights @ palette is the color, or its projection to the hull. Rows sum to 1 and have at most 4 nonzeros. Weights
    are continuous in the color; entries inside the hull of the others get none.

    Examples:
        >>> star_weights(np.array([[0.5, 0.25, 0.0]]), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).tolist()
        [[0.25, 0.5, 0.25]]
    """
    return star_weights_in(_star(palette), colors, len(palette))


def palette_weights_of_image(image: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the `star_weights` [H, W, M] of a uint8 picture [H, W, 3], evaluated once per distinct color.

    Examples:
        >>> palette_weights_of_image(np.array([[[51, 0, 0]]], np.uint8), np.array([[0, 0, 0], [1, 0, 0]])).round(3)
        array([[[0.8, 0.2]]], dtype=float32)
    """
    packed = image.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
    unique, inverse = np.unique(packed, return_inverse=True)
    colors = np.stack([unique >> 16, unique >> 8 & 255, unique & 255], axis=-1) / 255
    return star_weights(colors, palette)[inverse].reshape(*image.shape[:2], len(palette))


def outside_distance(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Return the distance [n] of colors, sRGB [n, 3], to the hull of a palette [M, 3]; 0 inside.

    Examples:
        >>> outside_distance(np.array([[0.5, 0, 0], [0, 0, 0.5]]), np.array([[0, 0, 0], [1, 0, 0]])).tolist()
        [0.0, 0.5]
    """
    colors = np.asarray(colors, np.float64)
    star = _star(palette)
    if star is None:
        return np.linalg.norm(colors, axis=1)
    local = colors @ star.span
    off_span = ((colors - local @ star.span.T) ** 2).sum(axis=1)
    return np.sqrt(off_span + to_hull(star, local)[1])
