"""How far points and Gaussians are from the objects' borders, and Gaussians of objects whose edges an edit moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..capture.capture import View
from ..compute.neighbors import tree_of
from ..palettes.edge_shape import EdgeShape, shaped_edges
from ..palettes.edges_in_space import MOST_REACH, Borders, shares_with_edges
from ..palettes.palette import AddedColor, Palette
from ..splats.gaussians import Gaussians
from .splat_colors import NEGLIGIBLE, ObjectSplats, splats_of_objects

OPACITY = 10  # column of a table of Gaussians
# The distance to the third nearest point of the other side counts, as single ones may be strays. That is so many spacings
# more than the border's own on points that are spread evenly on a plane, where half an edge's width is some spacings
NEIGHBORS, BEYOND = 3, 0.75
LEAST_LOGIT = -2.0  # of the opacity of Gaussians that make a border: 12 %
SAMPLED = 5000  # points of an object whose spacing is measured


def borders_of(positions: np.ndarray, shares: np.ndarray, counts: np.ndarray, views: Sequence[View]) -> Borders:
    """How far points are from the objects' borders.

    Args:
        positions: [N, 3], world.
        shares: [N, K], probabilities of the objects.
        counts: [N] bool, which points make a border.
        views: Of the capture, whose pixels are measured.
    """
    distances = np.full(shares.shape, -np.inf, np.float32)
    spacings, pixels = np.ones(shares.shape[1], np.float32), np.ones(shares.shape[1], np.float32)
    for k, is_own in enumerate((shares > 0.5).T):
        own = positions[is_own & counts]
        if len(own) > NEIGHBORS:
            spacings[k], pixels[k] = _spacing(own), _pixel(np.median(own, axis=0), views)
            distances[:, k] = _signed_distances(positions, is_own, counts, spacings[k])
    return Borders(distances, spacings, pixels)


def _signed_distances(positions: np.ndarray, is_own: np.ndarray, counts: np.ndarray, spacing: float) -> np.ndarray:
    """[N] world units, over 0 where a point is the object's."""
    result = np.zeros(len(positions), np.float32)
    for side, sign in ((is_own, 1), (~is_own, -1)):
        others = positions[~side & counts]
        if len(others) < NEIGHBORS:
            result[side] = sign * np.inf
            continue
        found, _ = tree_of(others).query(positions[side], [NEIGHBORS])
        result[side] = sign * np.maximum(found[:, 0] - BEYOND * spacing, spacing / 4)
    return result


def _spacing(positions: np.ndarray) -> float:
    """The median distance of points [n, 3] to the nearest other one."""
    some = positions[:: len(positions) // SAMPLED + 1]
    found, _ = tree_of(positions).query(some, [2])
    return max(float(np.median(found)), np.finfo(np.float32).tiny)


def _pixel(center: np.ndarray, views: Sequence[View]) -> float:
    """What a pixel of a photo spans at a place [3]: depth over focal length, the median of the views before it."""
    spans = []
    for camera in (view.camera for view in views):
        depth = (camera.camera_to_world[:3, 3] - center) @ camera.camera_to_world[:3, 2]  # the camera looks down -z
        if depth > 0:
            spans.append(depth / np.sqrt(camera.fx * camera.fy))
    return float(np.median(spans)) if spans else 1.0


class EdgedSplats:
    """A model's Gaussians by object, whose edges can be given any shape, any number of times.

    Args:
        gaussians: As learned.
        shares: [n, K], probabilities of the objects.
        palettes: Of the K objects, as learned.
        views: Of the capture, whose pixels are measured.
    """

    def __init__(
        self, gaussians: Gaussians, shares: np.ndarray, palettes: Sequence[Palette], views: Sequence[View]
    ) -> None:
        self._gaussians, self._shares, self._palettes = gaussians, shares, palettes
        self._names = [palette.name for palette in palettes]
        solid = gaussians.table[: gaussians.n_solid]
        near = borders_of(solid[:, :3], shares[: len(solid)], solid[:, OPACITY] > LEAST_LOGIT, views)
        distances = np.full(shares.shape, -np.inf, np.float32)
        distances[: len(solid)] = near.distances
        self._borders = replace(near, distances=distances)
        self._widest: tuple[str, tuple[ObjectSplats, ...]] = ("", ())
        self._known: tuple[tuple[str, str], tuple[ObjectSplats, ...]] = (("", ""), ())

    def objects(
        self, edges: Mapping[str, EdgeShape], added: Mapping[str, Sequence[AddedColor]]
    ) -> tuple[ObjectSplats, ...]:
        """The Gaussians of each object with edges of these shapes; the last ones are kept.

        Args:
            edges: By object; those without one stay as they are.
            added: Added colors by object.
        """
        asked = repr(shaped_edges(edges)), repr(added)
        if self._known[0] != asked:
            shares = shares_with_edges(self._shares, self._borders, self._names, edges)
            self._known = asked, tuple(_within(own, shares[:, k]) for k, own in enumerate(self._reached(added)))
        return self._known[1]

    def _reached(self, added: Mapping[str, Sequence[AddedColor]]) -> tuple[ObjectSplats, ...]:
        """The Gaussians that each object could reach by any edge."""
        if not self._widest[1] or self._widest[0] != repr(added):
            is_near = self._borders.distances > -MOST_REACH * self._borders.pixels
            reached = np.maximum(self._shares, np.where(is_near, 2 * NEGLIGIBLE, 0))
            self._widest = repr(added), splats_of_objects(self._gaussians, reached, self._palettes, added)
        return self._widest[1]


def _within(reached: ObjectSplats, shares: np.ndarray) -> ObjectSplats:
    """Those of an object's Gaussians that have a share of it, of all shares [n]."""
    own = shares[reached.rows]
    kept = own > NEGLIGIBLE
    return ObjectSplats(reached.rows[kept], own[kept], reached.weights[kept], reached.slopes[kept])
