"""Move and fade objects' edges in edit planes; shapes as in `compositing`.

A pixel of coverage c shows c own + (1 - c) beside, where `own` is the object's color and `beside` the rest. If its
coverage grows to c', the object's color becomes (c own + (c' - c) beside) / c', and its weights are those of this
color. So a rim misclassified as background changes with the object, and true background barely, as it shares few of
the object's colors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .added import split_weights
from .edge_shape import MAX_CHOKE, MAX_FEATHER, EdgeShape, active_edges, bounding_box, dilate_bbox, erode, feather
from .palette import AddedColor, Palette
from .star import plain_hull, star_of, star_weights_in

FULL = 1 - 1 / 64  # coverage above which nothing remains to cover


class ObjectEdge:
    """An object in a picture whose edge can be reshaped repeatedly.

    `weights` [N, h, w] float32 are updated in place; `place` is the box [h, w] that contains every possible edge.
    """

    def __init__(
        self,
        base: np.ndarray,  # the unedited picture, uint8 [H, W, 3], or float sRGB in [0, 1]
        weights: np.ndarray,  # [M, H, W], coverage included
        coverage: np.ndarray,  # [H, W] in [0, 1]
        room: np.ndarray,  # [H, W], the part of each pixel not covered by other objects
        palette: np.ndarray,  # [M, 3] as learned
        scale: float,  # pixels of this picture per pixel of the photo at full size
        added: Sequence[AddedColor] = (),  # over their sets the weights are spread: N entries in all
    ) -> None:
        coverage = np.asarray(coverage, np.float32)
        margin = EdgeShape(-MAX_CHOKE, MAX_FEATHER).reach(scale)
        box = bounding_box(coverage > 0)
        self.place = dilate_bbox(box, margin, coverage.shape) if box else (slice(0, 0), slice(0, 0))
        self._base, self._scale = base[self.place].reshape(-1, 3), scale
        self._before = np.ascontiguousarray(coverage[self.place])
        self._limit = np.maximum(self._before, room[self.place])
        self._choked = 0.0, self._before  # last choke and its result, as often only feather is dragged
        self._after = self._before
        self._palette, self._added = np.asarray(palette, np.float32), added
        self._star = star_of(self._palette, plain_hull)
        self._learned = weights[:, *self.place].astype(np.float32)
        self.weights = split_weights(self._learned, self._palette, added).copy()
        # [h w, N], contiguous per pixel: its weights; if uncovered, those that full coverage would have
        self._whole = self.weights.reshape(len(self.weights), -1).T.copy()
        self._is_known = self._before.ravel() > 0

    def shaped(self, shape: EdgeShape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Update `weights` to an edge of this shape.

        Returns the coverage [h, w] float32 in `place`; flat indices [n] in `place` of the pixels changed since the
        previous call, and their weights [N, n].
        """
        if self._choked[0] != shape.choke:
            self._choked = shape.choke, erode(self._before, shape.choke * self._scale)
        after = np.minimum(feather(self._choked[1], shape.feather * self._scale), self._limit)
        pixels = np.flatnonzero(after != self._after)
        self._after = after
        old, new = self._before.ravel()[pixels], after.ravel()[pixels]
        self._compute_uncovered(pixels[old == 0])
        own = np.ascontiguousarray(self._whole[pixels].T)
        own *= np.divide(np.minimum(old, new), old, out=new.copy(), where=old > 0)
        grown = np.flatnonzero((new > old) & (old > 0) & (old < FULL))
        if len(grown):
            own[:, grown] = self._grown(pixels[grown], old[grown], new[grown])
        for plane, plane_own in zip(self.weights, own, strict=True):  # faster than all at once
            plane.reshape(-1)[pixels] = plane_own
        return after, pixels, own

    def _colors(self, pixels: np.ndarray) -> np.ndarray:
        colors = self._base[pixels]
        return colors / np.float32(255) if colors.dtype == np.uint8 else colors

    def _weights_of(self, colors: np.ndarray) -> np.ndarray:
        return star_weights_in(self._star, colors, len(self._palette)).T

    def _compute_uncovered(self, pixels: np.ndarray) -> None:
        """Compute the weights of uncovered pixels, once each."""
        unknown = pixels[~self._is_known[pixels]]
        if len(unknown):
            beside = self._weights_of(self._colors(unknown))
            self._whole[unknown] = split_weights(beside, self._palette, self._added).T
            self._is_known[unknown] = True

    @cached_property
    def _mixed(self) -> _MixedPixels:
        before, learned = self._before.ravel(), self._learned.reshape(len(self._learned), -1)
        pixels = np.flatnonzero((before > 0) & (before < FULL))
        old, weights = before[pixels, None], learned[:, pixels]
        own = weights.T @ self._palette
        beside = np.clip((self._colors(pixels) - own) / (1 - old), 0, 1)
        return _MixedPixels(pixels, own, beside, weights - old.T * self._weights_of(own / old))

    def _grown(self, pixels: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return the weights [N, n] of partly covered pixels whose coverage [n] grows."""
        chosen = np.searchsorted(self._mixed.pixels, pixels)
        grown = self._mixed.own[chosen] + (after - before)[:, None] * self._mixed.beside[chosen]
        now = after * self._weights_of(grown / after[:, None])
        return split_weights(np.maximum(self._mixed.residual[:, chosen] + now, 0), self._palette, self._added)


@dataclass(frozen=True)
class _MixedPixels:
    """Quantities of partly covered pixels that do not depend on the new coverage."""

    pixels: np.ndarray  # [n], flat indices, ascending
    own: np.ndarray  # [n, 3], the object's color times coverage
    beside: np.ndarray  # [n, 3], the color of the rest
    residual: np.ndarray  # [M, n], weights minus those of the own color: rendered weights are not a function of it


def apply_edges_to_planes(
    base: np.ndarray,  # the unedited picture, uint8 [H, W, 3], or float sRGB in [0, 1]
    weights: np.ndarray,  # [K, M, H, W]
    probabilities: np.ndarray,  # [K, H, W]
    palettes: Sequence[Palette],  # of the K objects, as learned
    edges: Mapping[str, EdgeShape],  # by object; other edges stay
    scale: float,  # pixels of this picture per pixel of the photo at full size
) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture's weights and probabilities after moving and fading edges; unchanged if all are neutral."""
    edges = active_edges(edges)
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
