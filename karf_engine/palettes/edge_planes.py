"""Edit planes whose objects' edges an edit has moved and faded. Numpy alone.

Naming as in `compositing`. An object's share of a pixel is painted by the weights of its own color there. A pixel of
coverage c shows c own + (1 - c) beside; where it gets c' > c, the object's own color in it becomes what it shows then:
(c own + (c' - c) beside) / c'. So a rim of the object that was taken for the background changes as the object does, and
a true background little, as it has few of the object's colors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .edge_shape import MOST_CHOKE, MOST_FEATHER, EdgeShape, box_of, grown_box, shaped, shaped_edges
from .palette import Palette
from .star import plain_hull, star_of, weights_in

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

    Attributes:
        place: Rows and columns of the box beyond which no edge reaches.
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
        self._base, self._room, self._scale = base, room, scale
        self._palette = np.asarray(palette, np.float32)
        self._coverage = np.asarray(coverage, np.float32)
        most = EdgeShape(-MOST_CHOKE, MOST_FEATHER).reach(scale)
        self.place = grown_box(box_of(self._coverage > 0), most, self._coverage.shape) or (slice(0, 0), slice(0, 0))
        self._learned = weights[:, *self.place].astype(np.float32)
        self._weights, self._moved = self._learned.copy(), np.zeros(0, np.intp)
        self._star = star_of(self._palette, plain_hull)
        # weights of what lies beside the object, by pixel, and where they are known
        self._beside = np.zeros((self._coverage.size, len(self._palette)), np.float32)
        self._is_known = np.zeros(self._coverage.size, bool)

    def shaped(self, shape: EdgeShape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The object with an edge of this shape, in `place`.

        Returns:
            Weights [M, h, w] and coverage [h, w], both float32, the weights overwritten by the next call; and the pixels
            [n] of the place, by running number, that differ from those of the call before.
        """
        before = self._coverage[self.place]
        after = shaped(before, shape, self._scale, self._room[self.place])
        weights, learned = (each.reshape(len(each), -1) for each in (self._weights, self._learned))
        is_moved = (after != before).ravel()
        moved = np.flatnonzero(is_moved)
        is_moved[self._moved] = True
        changed, restored = np.flatnonzero(is_moved), self._moved
        self._moved = moved
        old, new = before.ravel()[moved], after.ravel()[moved]
        kept = np.divide(np.minimum(old, new), old, out=np.ones_like(old), where=old > 0)
        own = np.take(learned, moved, axis=1) * kept
        is_grown = (new > old) & (old < FULL)
        own[:, is_grown] = self._grown_weights(own[:, is_grown], moved[is_grown], old[is_grown], new[is_grown])
        for plane, plane_learned, plane_own in zip(weights, learned, own, strict=True):  # faster than all at once
            plane[restored] = plane_learned[restored]
            plane[moved] = plane_own
        return self._weights, after, changed

    def _grown_weights(
        self, weights: np.ndarray, places: np.ndarray, before: np.ndarray, after: np.ndarray
    ) -> np.ndarray:
        """Weights [M, n] of pixels whose coverage [n] grows, from those that they had; places: their numbers [n] in `place`."""
        rows, columns = np.divmod(places, self.place[1].stop - self.place[1].start)
        pixels = (rows + self.place[0].start) * self._coverage.shape[1] + columns + self.place[1].start
        is_new = before == 0
        weights[:, is_new] = after[is_new] * self._weights_beside(pixels[is_new]).T
        is_mixed = ~is_new
        weights[:, is_mixed] = self._grown(pixels[is_mixed], weights[:, is_mixed], before[is_mixed], after[is_mixed])
        return weights

    def _colors(self, pixels: np.ndarray) -> np.ndarray:
        """Colors [n, 3] of pixels of the picture, by running number."""
        colors = self._base.reshape(-1, 3)[pixels]
        return colors / np.float32(255) if colors.dtype == np.uint8 else colors

    def _weights_beside(self, pixels: np.ndarray) -> np.ndarray:
        """Weights [n, M] of what pixels show that the object does not cover: found once for each."""
        unknown = pixels[~self._is_known[pixels]]
        self._beside[unknown] = weights_in(self._star, self._colors(unknown), len(self._palette))
        self._is_known[unknown] = True
        return self._beside[pixels]

    def _grown(self, pixels: np.ndarray, weights: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Weights [M, n] of mixed pixels whose coverage [n] grows, from those that they had."""
        own = weights.T @ self._palette
        beside = np.clip((self._colors(pixels) - own) / (1 - before)[:, None], 0, 1)
        grown = own + (after - before)[:, None] * beside
        # as a change of what there was: the weights of a rendering are no function of its colors
        now, then = (
            part * weights_in(self._star, color / part[:, None], len(self._palette)).T
            for color, part in ((grown, after), (own, before))
        )
        return np.maximum(weights + now - then, 0)


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
            planes, coverage, _ = edge.shaped(edges[palette.name])
            result[k, :count, *edge.place], coverages[k, *edge.place] = planes, coverage
    return result, coverages
