"""Palette weights of a color: star tessellation of the palette's hull, seen from black.

Naming: palette [M, 3] with black as entry 0; its hull is cut into simplices ("cones") that join black to one facet. In
the span of the palette (rank r = 1, 2 or 3) a facet has r corners. A color inside the hull lies in one cone and is the
only convex mix of black and the facet's corners; a color outside is first moved to the nearest point of the hull. The
weights are a function of the color alone, so the same color gets the same weights in every view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

FLAT = 1e-5  # extent, in units of color, below which a palette has no thickness in a direction
SLIVER = 1e-8  # cone volume below which neighbors cover the cone
CHUNK = 16384  # colors processed at a time: the scratch arrays stay in a core's cache


@dataclass(frozen=True)
class Star:
    """A palette's hull in its own span, of rank r, with F facets, of which G make cones with black, and E edges.

    Attributes:
        span: [3, r] orthonormal columns.
        points: [M, r] palette in the span.
        facets: [F, r] int, palette indices of the hull's facets.
        normals: [F, r], outward.
        offsets: [F], with normals @ x + offsets <= 0 inside.
        cones: [G, r] int, facets that do not lie in a plane with black.
        to_cone: [G, r, r]; x @ to_cone gives the weights of the facet's corners.
        edges: [E, 2] int, palette indices of the hull's edges.
    """

    span: np.ndarray
    points: np.ndarray
    facets: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray
    cones: np.ndarray
    to_cone: np.ndarray
    edges: np.ndarray


def make_star(palette: np.ndarray) -> Star | None:
    """The star tessellation of a palette.

    Args:
        palette: [M, 3] sRGB in [0, 1], entry 0 black.

    Returns:
        None where every entry is black.

    Example:
        >>> np.sort(make_star(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])).cones).tolist()
        [[1, 2]]
    """
    palette = np.asarray(palette, np.float64)
    axes = np.linalg.svd(palette, full_matrices=False)[2]
    extent = np.abs(palette @ axes.T).max(axis=0)
    span = axes[extent > FLAT].T
    rank = span.shape[1]
    if rank == 0:
        return None
    points = palette @ span
    if rank == 1:
        end = int(np.abs(points).argmax())
        facets = np.array([[end], [0]])
        normals = np.array([[1.0], [-1.0]]) * np.sign(points[end])
        offsets = np.array([-abs(points[end, 0]), 0.0])
        edges = np.array([[0, end]])
    else:
        hull = ConvexHull(points)
        facets, normals, offsets = hull.simplices, hull.equations[:, :-1], hull.equations[:, -1]
        pairs = [facets[:, pair] for pair in ([0, 1], [0, 2], [1, 2])[: 1 if rank == 2 else 3]]
        edges = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    volume = np.abs(np.linalg.det(points[facets]))
    cones = facets[(volume > SLIVER) & ~(facets == 0).any(axis=1)]
    return Star(span, points, facets, normals, offsets, cones, np.linalg.inv(points[cones]), edges)


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
    colors = np.asarray(colors)
    weights = np.zeros((len(colors), len(palette)), np.float32)
    star = make_star(palette)
    if star is None:
        weights[:, 0] = 1
        return weights
    for start in range(0, len(colors), CHUNK):
        chunk = slice(start, start + CHUNK)
        weights[chunk] = _weights(star, _to_hull(star, colors[chunk] @ star.span)[0])
    return weights


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
    return np.sqrt(beside + _to_hull(star, local)[1])


def _weights(star: Star, points: np.ndarray) -> np.ndarray:
    """Weights [n, M] of points [n, r] of the hull."""
    # [G, n, r]: as mixes of each cone's corners; the cone that holds the point is the one without negative parts
    mixes = points @ star.to_cone
    cone = mixes.min(axis=2).argmax(axis=0)
    rows = np.arange(len(points))
    mix = np.maximum(mixes[cone, rows], 0)
    # rounding may carry a point of the hull's face past it
    mix /= np.maximum(mix.sum(axis=1), 1)[:, None]
    weights = np.zeros((len(points), len(star.points)))
    weights[rows[:, None], star.cones[cone]] = mix
    weights[:, 0] = 1 - mix.sum(axis=1)
    return np.maximum(weights, 0)


def _to_hull(star: Star, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The hull's nearest point to each of points [n, r], and the squared distance [n]."""
    heights = points @ star.normals.T + star.offsets
    outside = np.flatnonzero(heights.max(axis=1) > 0)
    moved, squared = points.copy(), np.zeros(len(points))
    if len(outside):
        moved[outside], squared[outside] = _to_edges(star, points[outside])
        if star.points.shape[1] == 3:
            _to_faces(star, points, heights, outside, moved, squared)
    return moved, squared


def _to_edges(star: Star, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest point of any edge of the hull, and the squared distance."""
    start = star.points[star.edges[:, 0]]
    along = star.points[star.edges[:, 1]] - start
    length = (along**2).sum(axis=1)
    along_point = points @ along.T - (start * along).sum(axis=1)
    share = np.clip(along_point / length, 0, 1)
    from_start = (points**2).sum(axis=1)[:, None] - 2 * points @ start.T + (start**2).sum(axis=1)
    squared = from_start - share * (2 * along_point - share * length)
    best = squared.argmin(axis=1)
    rows = np.arange(len(points))
    nearest = start[best] + share[rows, best][:, None] * along[best]
    return nearest, ((points - nearest) ** 2).sum(axis=1)


def _to_faces(
    star: Star, points: np.ndarray, heights: np.ndarray, outside: np.ndarray, moved: np.ndarray, squared: np.ndarray
) -> None:
    """Replace moved and squared, in place, by the foot point on a face where that is inside the face and nearer."""
    for face, normal in enumerate(star.normals):
        above = outside[heights[outside, face] > 0]
        above = above[heights[above, face] ** 2 < squared[above]]
        foot = points[above] - heights[above, face][:, None] * normal
        # the foot is on the hull where no other facet has it outside
        lies = (foot @ star.normals.T + star.offsets).max(axis=1, initial=-np.inf) < 1e-9
        above, foot = above[lies], foot[lies]
        moved[above], squared[above] = foot, heights[above, face] ** 2
