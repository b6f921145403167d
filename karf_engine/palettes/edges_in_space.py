"""Where an object's paint ends on points in space: edges that are moved and faded in world units. Numpy alone.

Pictures move edges by pixels (`edge_shape`); a point has none, so that a pixel of a photo becomes a length: what it spans
where the object is, in the middle of the photos. An object's share of a point is then a function of how far the point is
from the object's border.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .edge_shape import MOST_CHOKE, MOST_FEATHER, EdgeShape

MOST_REACH = MOST_CHOKE + MOST_FEATHER / 2  # pixels beyond an object that an edge can cover


@dataclass(frozen=True)
class Borders:
    """How far N points are from the borders of K objects.

    Attributes:
        distances: [N, K] float32, world units, over 0 inside an object and below 0 outside; infinite where no border is.
        spacings: [K] float32, how far apart points of an object are, world units.
        pixels: [K] float32, what a pixel of a photo at its full size spans at an object, world units.
    """

    distances: np.ndarray
    spacings: np.ndarray
    pixels: np.ndarray


def shares_with_edges(
    shares: np.ndarray, borders: Borders, objects: Sequence[str], edges: Mapping[str, EdgeShape]
) -> np.ndarray:
    """Objects' shares of points with the edges that an edit wants.

    An edge fades along the profile that it has in pictures. No edge spreads into another object.

    Args:
        shares: [N, K] in [0, 1].
        borders: Of these points.
        objects: Names of the K objects.
        edges: By object; those without one stay as they are.

    Returns:
        [N, K] float32; the columns of objects whose edges stay have the numbers that were there.

    Examples:
        Four points in a row, a unit apart, of which the last two are the pot's; a pixel spans a unit:

        >>> shares, distances = np.array([[0.0], [0], [1], [1]]), np.array([[-1.5], [-0.5], [0.5], [1.5]])
        >>> borders = Borders(distances, np.ones(1), np.ones(1))
        >>> for shape in (EdgeShape(choke=1), EdgeShape(choke=-1), EdgeShape(feather=4)):
        ...     print(shares_with_edges(shares, borders, ["pot"], {"pot": shape})[:, 0].round(2))
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
    """Shares [N] of one object; what is half its own moves along with its edge, within a point's spacing."""
    choke, width = shape.choke * pixel, max(shape.feather * pixel, 1e-6 * spacing)
    covered = _profile((distance - choke) / width)
    by = np.clip(choke / spacing, -1, 1)
    inside = (share + (1 - share) * max(0.0, -by)) * covered
    return np.where(distance > 0, inside, np.maximum(covered, share * (1 - max(0.0, by))))


def _profile(place: np.ndarray) -> np.ndarray:
    """How much is covered at a place across a fading edge, whose width is 1: two boxes, as `edge_shape.faded` has them."""
    place = np.clip(place, -0.5, 0.5)
    return np.where(place < 0, 2 * (place + 0.5) ** 2, 1 - 2 * (0.5 - place) ** 2).astype(np.float32)
