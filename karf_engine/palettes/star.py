"""Star tessellation of a palette's hull about black, and barycentric weights of colors in it.

A palette [M, 3], with black as entry 0, spans rank r = 1, 2 or 3; a facet of its hull has r corners. The hull is cut
into cones, simplices that join black to a facet. Hulls come from scipy (`palette_weights`) or, in Blender, from
`plain_hull`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

FLAT = 1e-5  # extent, in units of color, below which a palette is flat in a direction
ON_FACET = 1e-7  # distance of a coplanar point from a plane
SLIVER = 1e-8  # volume of negligible cones
CHUNK = 16384  # colors at a time, so that scratch arrays stay in a core's cache

Hull = tuple[np.ndarray, np.ndarray, np.ndarray]  # facets [F, r], outward normals [F, r], offsets [F]


@dataclass(frozen=True)
class Star:
    """Hull of a palette in its span of rank r, with F facets, G cones and E edges."""

    span: np.ndarray  # [3, r], orthonormal columns
    points: np.ndarray  # [M, r], the palette in the span
    facets: np.ndarray  # [F, r] int, palette indices
    normals: np.ndarray  # [F, r], outward
    offsets: np.ndarray  # [F]; normals @ x + offsets <= 0 inside
    cones: np.ndarray  # [G, r] int, facets not coplanar with black
    to_cone: np.ndarray  # [G, r, r]; x @ to_cone gives the weights of the facet's corners
    edges: np.ndarray  # [E, 2] int, palette indices


def star_of(palette: np.ndarray, find_hull: Callable[[np.ndarray], Hull]) -> Star | None:
    """Build the star of a palette [M, 3], entry 0 black, with hulls of points [M, r] by `find_hull`; None if all black."""
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
        facets, normals, offsets = find_hull(points)
        pairs = [facets[:, pair] for pair in ([0, 1], [0, 2], [1, 2])[: 1 if rank == 2 else 3]]
        edges = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0)
    volume = np.abs(np.linalg.det(points[facets]))
    cones = facets[(volume > SLIVER) & ~(facets == 0).any(axis=1)]
    return Star(span, points, facets, normals, offsets, cones, np.linalg.inv(points[cones]), edges)


def plain_hull(points: np.ndarray) -> Hull:
    """Return the hull of a few points [M, r], r = 2 or 3, that span their space, by testing every set of r points."""
    rank = points.shape[1]
    facets = np.array(list(combinations(range(len(points)), rank)))
    sides = points[facets[:, 1:]] - points[facets[:, :1]]
    normals = np.cross(sides[:, 0], sides[:, 1]) if rank == 3 else sides[:, 0] @ np.array([[0.0, -1.0], [1.0, 0.0]])
    length = np.linalg.norm(normals, axis=1)
    normals = np.divide(normals, length[:, None], out=np.zeros_like(normals), where=length[:, None] > FLAT**2)
    heights = normals @ points.T
    offsets = -np.take_along_axis(heights, facets[:, :1], axis=1)[:, 0]
    heights += offsets[:, None]
    is_behind = heights.max(axis=1) <= ON_FACET
    is_facet = (length > FLAT**2) & (is_behind | (heights.min(axis=1) >= -ON_FACET))
    sign = np.where(is_behind, 1.0, -1.0)[is_facet]
    return facets[is_facet], normals[is_facet] * sign[:, None], offsets[is_facet] * sign


def star_weights_in(star: Star | None, colors: np.ndarray, count: int) -> np.ndarray:
    """Return the weights [n, M] float32 of colors [n, 3] in a star of `count` = M entries; None weighs all as black."""
    colors = np.asarray(colors)
    weights = np.zeros((len(colors), count), np.float32)
    if star is None:
        weights[:, 0] = 1
        return weights
    for start in range(0, len(colors), CHUNK):
        chunk = slice(start, start + CHUNK)
        # [G, n, r]: barycentric in each cone; those of the cone that contains the point are not negative
        barycentric = to_hull(star, colors[chunk] @ star.span)[0] @ star.to_cone
        cone = barycentric.min(axis=2).argmax(axis=0)
        rows = np.arange(len(cone))
        corners = np.maximum(barycentric[cone, rows], 0)
        corners /= np.maximum(corners.sum(axis=1), 1)[:, None]  # rounding may put a point slightly outside
        weights[start + rows[:, None], star.cones[cone]] = corners
        weights[chunk, 0] = np.maximum(1 - corners.sum(axis=1), 0)
    return weights


def to_hull(star: Star, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project points [n, r] of the span to the hull; return the nearest points and the squared distances [n]."""
    heights = points @ star.normals.T + star.offsets
    outside = np.flatnonzero(heights.max(axis=1) > 0)
    moved, squared = points.copy(), np.zeros(len(points))
    if len(outside):
        moved[outside], squared[outside] = _to_edges(star, points[outside])
        if star.points.shape[1] == 3:
            _to_faces(star, points, heights, outside, moved, squared)
    return moved, squared


def _to_edges(star: Star, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nearest point on any edge of the hull, and the squared distance."""
    start = star.points[star.edges[:, 0]]
    along = star.points[star.edges[:, 1]] - start
    length = (along**2).sum(axis=1)
    projection = points @ along.T - (start * along).sum(axis=1)
    share = np.clip(projection / length, 0, 1)
    from_start = (points**2).sum(axis=1)[:, None] - 2 * points @ start.T + (start**2).sum(axis=1)
    squared = from_start - share * (2 * projection - share * length)
    best = squared.argmin(axis=1)
    rows = np.arange(len(points))
    nearest = start[best] + share[rows, best][:, None] * along[best]
    return nearest, ((points - nearest) ** 2).sum(axis=1)


def _to_faces(
    star: Star, points: np.ndarray, heights: np.ndarray, outside: np.ndarray, moved: np.ndarray, squared: np.ndarray
) -> None:
    """Update `moved` and `squared` in place where the foot of the perpendicular is on a face and nearer."""
    for face, normal in enumerate(star.normals):
        above = outside[heights[outside, face] > 0]
        above = above[heights[above, face] ** 2 < squared[above]]
        foot = points[above] - heights[above, face][:, None] * normal
        is_inside = (foot @ star.normals.T + star.offsets).max(axis=1, initial=-np.inf) < 1e-9
        above, foot = above[is_inside], foot[is_inside]
        moved[above], squared[above] = foot, heights[above, face] ** 2
