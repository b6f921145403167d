"""Edit planes whose objects' edges an edit has moved and faded. Numpy alone.

Naming as in `compositing`. An object's share of a pixel is painted by the weights of its own color there. A pixel of
coverage c shows c own + (1 - c) beside; where it gets c' > c, the object's own color in it becomes what it shows then:
(c own + (c' - c) beside) / c'. So a rim of the object that was taken for the background changes as the object does, and
a true background little, as it has few of the object's colors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .added import spread
from .edge_shape import MOST_CHOKE, MOST_FEATHER, EdgeShape, box_of, faded, grown_box, moved, shaped_edges
from .palette import AddedColor, Palette
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
        added: The object's added colors, over whose sets its weights are spread: N entries in all.

    Attributes:
        place: Rows and columns of the box beyond which no edge reaches, [h, w].
        weights: [N, h, w] float32 of the object as it was shaped last, in `place`; changed in place.
    """

    def __init__(
        self,
        base: np.ndarray,
        weights: np.ndarray,
        coverage: np.ndarray,
        room: np.ndarray,
        palette: np.ndarray,
        scale: float,
        added: Sequence[AddedColor] = (),
    ) -> None:
        coverage = np.asarray(coverage, np.float32)
        most = EdgeShape(-MOST_CHOKE, MOST_FEATHER).reach(scale)
        self.place = grown_box(box_of(coverage > 0), most, coverage.shape) or (slice(0, 0), slice(0, 0))
        self._base, self._scale = base[self.place].reshape(-1, 3), scale
        self._before = np.ascontiguousarray(coverage[self.place])
        self._most = np.maximum(self._before, room[self.place])
        self._moved = 0.0, self._before  # the choke of the call before, and what it left: often only feather is dragged
        self._after = self._before
        self._palette, self._added = np.asarray(palette, np.float32), added
        self._star = star_of(self._palette, plain_hull)
        self._learned = weights[:, *self.place].astype(np.float32)
        self.weights = spread(self._learned, self._palette, added).copy()
        # [h w, N], of a pixel together: the weights that it has, or where none is covered those that it had if all were
        self._whole = self.weights.reshape(len(self.weights), -1).T.copy()
        self._is_known = self._before.ravel() > 0

    def shaped(self, shape: EdgeShape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Let `weights` be those of the object with an edge of this shape.

        Returns:
            Coverage [h, w] float32, in `place`; the pixels [n] of the place, by running number, that differ from those of
            the call before, and their weights [N, n].
        """
        if self._moved[0] != shape.choke:
            self._moved = shape.choke, moved(self._before, shape.choke * self._scale)
        after = np.minimum(faded(self._moved[1], shape.feather * self._scale), self._most)
        pixels = np.flatnonzero(after != self._after)
        self._after = after
        old, new = self._before.ravel()[pixels], after.ravel()[pixels]
        self._know(pixels[old == 0])
        own = np.ascontiguousarray(self._whole[pixels].T)
        own *= np.divide(np.minimum(old, new), old, out=new.copy(), where=old > 0)
        grown = np.flatnonzero((new > old) & (old > 0) & (old < FULL))
        if len(grown):
            own[:, grown] = self._grown(pixels[grown], old[grown], new[grown])
        for plane, plane_own in zip(self.weights, own, strict=True):  # faster than all at once
            plane.reshape(-1)[pixels] = plane_own
        return after, pixels, own

    def _colors(self, pixels: np.ndarray) -> np.ndarray:
        """Colors [n, 3] of pixels of the place, by running number."""
        colors = self._base[pixels]
        return colors / np.float32(255) if colors.dtype == np.uint8 else colors

    def _weights_of(self, colors: np.ndarray) -> np.ndarray:
        """Weights [M, n] of colors [n, 3]."""
        return weights_in(self._star, colors, len(self._palette)).T

    def _know(self, pixels: np.ndarray) -> None:
        """Find the weights of what pixels show that the object does not cover: once for each."""
        unknown = pixels[~self._is_known[pixels]]
        if len(unknown):
            beside = self._weights_of(self._colors(unknown))
            self._whole[unknown] = spread(beside, self._palette, self._added).T
            self._is_known[unknown] = True

    @cached_property
    def _mixed(self) -> _MixedPixels:
        """What is the same of mixed pixels whatever they grow to."""
        before, learned = self._before.ravel(), self._learned.reshape(len(self._learned), -1)
        pixels = np.flatnonzero((before > 0) & (before < FULL))
        old, weights = before[pixels, None], learned[:, pixels]
        own = weights.T @ self._palette
        beside = np.clip((self._colors(pixels) - own) / (1 - old), 0, 1)
        return _MixedPixels(pixels, own, beside, weights - old.T * self._weights_of(own / old))

    def _grown(self, pixels: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Weights [N, n] of mixed pixels whose coverage [n] grows."""
        chosen = np.searchsorted(self._mixed.pixels, pixels)
        grown = self._mixed.own[chosen] + (after - before)[:, None] * self._mixed.beside[chosen]
        now = after * self._weights_of(grown / after[:, None])
        return spread(np.maximum(self._mixed.left[:, chosen] + now, 0), self._palette, self._added)


@dataclass(frozen=True)
class _MixedPixels:
    """Pixels of a place that an object covers in part.

    Attributes:
        pixels: [n], running numbers in ascending order.
        own: [n, 3], what they show of the object.
        beside: [n, 3], the color that they have beside it.
        left: [M, n], what their weights have that those of their own color have not: the weights of a rendering are no
            function of its colors.
    """

    pixels: np.ndarray
    own: np.ndarray
    beside: np.ndarray
    left: np.ndarray


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
            coverages[k, *edge.place] = edge.shaped(edges[palette.name])[0]
            result[k, :count, *edge.place] = edge.weights
    return result, coverages
