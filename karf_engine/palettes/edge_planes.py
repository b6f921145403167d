"""Edit planes whose objects' edges an edit has moved and faded. Numpy alone.

Naming as in `compositing`. An object's share of a pixel is painted by the weights of its own color there. What an edge
newly covers had another color, that of what lies beside the object, and is painted by the weights of this one: a rim of
the object that was taken for the background changes as the object does, and a true background hardly, so that nothing
glows. A pixel of coverage c that gets c' shows c own + (1 - c) beside; its weights become c w(own) + (c' - c) w(beside).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .edge_shape import EdgeShape, box_of, grown_box, shaped, shaped_edges
from .palette import Palette
from .star import Star, plain_hull, star_of, weights_in

FULL = 1 - 1 / 64  # coverage above which nothing is left that could be newly covered


class ObjectEdge:
    """An object in a picture, whose edge can be given any shape, any number of times.

    Args:
        base: The picture without the edit, uint8 [H, W, 3], or float sRGB in [0, 1].
        weights: [M, H, W], entry's shares, coverage included.
        coverage: [H, W] in [0, 1].
        room: [H, W], what other objects leave of each pixel.
        palette: [M, 3] as learned.
        scale: Pixels of this picture for one of the photo at its full size.
    """

    def __init__(
        self,
        base: np.ndarray,
        weights: np.ndarray,
        coverage: np.ndarray,
        room: np.ndarray,
        palette: np.ndarray,
        scale: float,
    ) -> None:
        self._base, self._weights, self._room = base, weights, room
        self._palette, self._scale = np.asarray(palette, np.float32), scale
        self._coverage = np.asarray(coverage, np.float32)
        self._box = box_of(self._coverage > 0)
        self._star: Star | None = star_of(self._palette, plain_hull)

    def shaped(self, shape: EdgeShape) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
        """The object with an edge of this shape.

        Returns:
            Rows and columns of the box outside which it is not; in it the weights [M, h, w], and the coverage [h, w], both
            float32.
        """
        place = grown_box(self._box, shape.reach(self._scale), self._coverage.shape) or (slice(0, 0), slice(0, 0))
        before, weights = self._coverage[place], self._weights[:, *place].astype(np.float32)
        after = shaped(before, shape, self._scale, self._room[place])
        less = after < before
        weights[:, less] *= after[less] / before[less]
        more = (after > before) & (before < FULL)
        weights[:, more] += (after[more] - before[more]) * self._beside(
            self._base[place][more], weights[:, more], before[more]
        )
        return place, weights, after

    def _beside(self, seen: np.ndarray, weights: np.ndarray, coverage: np.ndarray) -> np.ndarray:
        """Weights [M, n] of what lies beside the object in pixels of seen colors [n, 3], own weights, and coverage [n]."""
        colors = seen / np.float32(255) if seen.dtype == np.uint8 else seen
        beside = (colors - weights.T @ self._palette) / (1 - coverage)[:, None]
        return weights_in(self._star, np.clip(beside, 0, 1), len(self._palette)).T


def reshaped(
    base: np.ndarray,
    weights: np.ndarray,
    probabilities: np.ndarray,
    palettes: Sequence[Palette],
    edges: Mapping[str, EdgeShape],
    scale: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Weights and probabilities of a picture with the edges that an edit wants.

    Args:
        base: The picture without the edit, uint8 [H, W, 3], or float sRGB in [0, 1].
        weights: [K, M, H, W].
        probabilities: [K, H, W].
        palettes: Of the K objects, as learned.
        edges: By object; those without one stay as they are.
        scale: Pixels of this picture for one of the photo at its full size.

    Returns:
        Both anew; where no edge is to change, those that were given.

    Examples:
        A pot in the right half of a red picture grows by a pixel:

        >>> pot = Palette("pot", np.array([[0, 0, 0], [1, 0, 0]]))
        >>> coverage = np.array([[[0, 0, 1, 1]]], np.float32)
        >>> base = np.array([[[255, 0, 0]] * 4], np.uint8)
        >>> weights = np.stack([0 * coverage, coverage], axis=1)
        >>> weights, coverage = reshaped(base, weights, coverage, [pot], {"pot": EdgeShape(choke=-1)}, 1.0)
        >>> weights[0, :, 0].tolist()
        [[0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1.0, 1.0]]
    """
    edges = shaped_edges(edges)
    if not edges:
        return weights, probabilities
    result, coverages, total = weights.copy(), probabilities.copy(), probabilities.sum(axis=0, dtype=np.float32)
    for k, palette in enumerate(palettes):
        if palette.name in edges:
            count, room = len(palette.colors), 1 - (total - probabilities[k])
            edge = ObjectEdge(base, weights[k, :count], probabilities[k], room, palette.colors, scale)
            place, planes, coverage = edge.shaped(edges[palette.name])
            result[k, :count, *place], coverages[k, *place] = planes, coverage
    return result, coverages
