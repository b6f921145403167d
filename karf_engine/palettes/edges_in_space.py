"""Move and fade the edges of objects on points in space, in world units.

A pixel of `edge_shape` becomes a length: its median footprint at the object over the photos. An object's share of a
point is then a function of the point's distance to the object's border.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .edge_shape import MAX_CHOKE, MAX_FEATHER, EdgeShape

MAX_EDGE_REACH = MAX_CHOKE + MAX_FEATHER / 2  # pixels that an edge can extend beyond an object


@dataclass(frozen=True)
class Borders:
    """Signed distances of N points to the borders of K objects.

    Attributes:
        distances: [N, K] float32, world units, positive inside; infinite where there is no border.
        spacings: [K] float32, spacing of an object's points, world units.
        pixels: [K] float32, footprint of a pixel of a full-size photo at an object, world units.
    """

    distances: np.ndarray
    spacings: np.ndarray
    pixels: np.ndarray


def apply_edges_to_points(
    shares: np.ndarray, borders: Borders, objects: Sequence[str], edges: Mapping[str, EdgeShape]
) -> np.ndarray:
    """Return the objects' shares of points after moving and fading edges.

    An edge fades with the same profile as in pictures, and does not grow into another object.

    Args:
        shares: [N, K] in [0, 1].
        borders: Of these points.
        objects: Names of the K objects.
        edges: By object; other edges stay.

    Returns:
        [N, K] float32; columns of unchanged edges keep their values.

    Examples:
        The last two of four points, a unit apart, are the pot's; a pixel is a unit wide:

        >>> shares, distances = np.array([[0.0], [0], [1], [1]]), np.array([[-1.5], [-0.5], [0.5], [1.5]])
        >>> borders = Borders(distances, np.ones(1), np.ones(1))
        >>> for shape in (EdgeShape(choke=1), EdgeShape(choke=-1), EdgeShape(feather=4)):
        ...     print(apply_edges_to_points(shares, borders, ["pot"], {"pot": shape})[:, 0].round(2))
        [0. 0. 0. 1.]
        [0. 1. 1. 1.]
        [0.03 0.28 0.72 0.97]
    """
    result = np.array(shares, np.float32)
    total = result.sum(axis=1)
    for k, name in enumerate(objects):
        shape = edges.get(name, EdgeShape())
        if not shape.is_neutral:
            before = np.asarray(shares[:, k], np.float32)
            after = _shaped(before, borders.distances[:, k], shape, borders.pixels[k], borders.spacings[k])
            result[:, k] = np.minimum(after, np.maximum(before, 1 - (total - before)))
    return result


def _shaped(share: np.ndarray, distance: np.ndarray, shape: EdgeShape, pixel: float, spacing: float) -> np.ndarray:
    """Return the shares [N] of one object; partial shares move with the edge, within a point's spacing."""
    choke, width = shape.choke * pixel, max(shape.feather * pixel, 1e-6 * spacing)
    covered = _profile((distance - choke) / width)
    by = np.clip(choke / spacing, -1, 1)
    inside = (share + (1 - share) * max(0.0, -by)) * covered
    return np.where(distance > 0, inside, np.maximum(covered, share * (1 - max(0.0, by))))


def _profile(place: np.ndarray) -> np.ndarray:
    """Return the coverage across a fading edge of width 1: two boxes, as in `edge_shape.feather`."""
    place = np.clip(place, -0.5, 0.5)
    return np.where(place < 0, 2 * (place + 0.5) ** 2, 1 - 2 * (0.5 - place) ** 2).astype(np.float32)
