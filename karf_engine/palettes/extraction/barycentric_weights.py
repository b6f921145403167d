"""Palette weights of a color: star tessellation of the palette's hull, seen from black.

Naming: palette [M, 3] with black as entry 0; its hull is cut into simplices ("cones") that join black to one facet. In
the span of the palette (rank r = 1, 2 or 3) a facet has r corners. A color inside the hull lies in one cone and is the
only convex mix of black and the facet's corners; a color outside is first moved to the nearest point of the hull. The
weights are a function of the color alone, so the same color gets the same weights in every view.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from ..star import Hull, Star, star_of, to_hull, weights_in


def make_star(palette: np.ndarray) -> Star | None:
    """The star of a palette [M, 3], by scipy's hull; see `palettes.star.star_of`.

    Example:
        >>> np.sort(make_star(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).cones).tolist()
        [[1, 2]]
    """
    return star_of(palette, _hull)


def _hull(points: np.ndarray) -> Hull:
    hull = ConvexHull(points)
    return hull.simplices, hull.equations[:, :-1], hull.equations[:, -1]


def star_weights(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Weights of each color over the palette, by the simplices that join black to the facets of the palette's hull.

    weights @ palette is the color where it lies in the palette's hull, and the hull's nearest point elsewhere.
    Continuous in the color. Entries inside the hull of the others get no weight.

    Args:
        colors: [n, 3] sRGB in [0, 1].
        palette: [M, 3] sRGB in [0, 1], entry 0 black; flat and single-hue palettes are fine.

    Returns:
        [n, M] float32 >= 0; rows sum to 1, with at most 4 non-zeros; black gives entry 0 alone.

    Example:
        >>> star_weights(np.array([[0.5, 0.25, 0.0]]), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).tolist()
        [[0.25, 0.5, 0.25]]
    """
    return weights_in(make_star(palette), colors, len(palette))


def palette_weights_of_image(image: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """`star_weights` of a picture, evaluated once for each color in it.

    Args:
        image: [H, W, 3] uint8 sRGB.
        palette: [M, 3] sRGB in [0, 1], entry 0 black.

    Returns:
        [H, W, M] float32 >= 0; sums to 1 over M.

    Example:
        >>> palette_weights_of_image(np.array([[[51, 0, 0]]], np.uint8), np.array([[0, 0, 0], [1, 0, 0]])).round(3)
        array([[[0.8, 0.2]]], dtype=float32)
    """
    packed = image.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)
    unique, inverse = np.unique(packed, return_inverse=True)
    colors = np.stack([unique >> 16, unique >> 8 & 255, unique & 255], axis=-1) / 255
    return star_weights(colors, palette)[inverse].reshape(*image.shape[:2], len(palette))


def outside_distance(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Distance of each color to the hull of the palette.

    Args:
        colors: [n, 3] sRGB in [0, 1].
        palette: [M, 3] sRGB in [0, 1], entry 0 black.

    Returns:
        [n] in units of color; 0 inside.

    Example:
        >>> outside_distance(np.array([[0.5, 0, 0], [0, 0, 0.5]]), np.array([[0, 0, 0], [1, 0, 0]])).tolist()
        [0.0, 0.5]
    """
    colors = np.asarray(colors, np.float64)
    star = make_star(palette)
    if star is None:
        return np.linalg.norm(colors, axis=1)
    local = colors @ star.span
    beside = ((colors - local @ star.span.T) ** 2).sum(axis=1)
    return np.sqrt(beside + to_hull(star, local)[1])
