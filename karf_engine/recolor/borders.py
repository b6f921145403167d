"""Distances of points and Gaussians to the borders of objects, and Gaussians of objects with moved edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..capture.capture import View
from ..compute.neighbors import build_kd_tree
from ..palettes.edge_shape import MAX_EDGE_REACH, Borders, EdgeShape, active_edges, apply_edges_to_points
from ..palettes.palette import AddedColor, Palette
from ..splats.gaussians import Gaussians
from .splat_colors import NEGLIGIBLE, ObjectSplats, splats_of_objects

OPACITY = 10  # column of a table of Gaussians
# The border is at the third nearest point of the other side, since single points may be outliers. On evenly spaced points
# this distance exceeds that of the border by 0.75 spacings.
NEIGHBORS, EXCESS = 3, 0.75
MIN_LOGIT = -2.0  # of the opacity of Gaussians that form a border: 12 %
MAX_SAMPLES = 5000  # points per object that the spacing is measured at


def measure_borders(positions: np.ndarray, shares: np.ndarray, counts: np.ndarray, views: Sequence[View]) -> Borders:
    """Measure the distance of points to the objects' borders.

    Args:
        positions: [N, 3], world.
        shares: [N, K], probabilities of the objects.
        counts: [N] bool, points that form borders.
        views: Of the capture, for the size of a pixel.
    """
    distances = np.full(shares.shape, -np.inf, np.float32)
    spacings, pixels = np.ones(shares.shape[1], np.float32), np.ones(shares.shape[1], np.float32)
    for k, is_own in enumerate((shares > 0.5).T):
        own = positions[is_own & counts]
        if len(own) > NEIGHBORS:
            spacings[k], pixels[k] = _spacing(own), _pixel_size(np.median(own, axis=0), views)
            distances[:, k] = _signed_distances(positions, is_own, counts, spacings[k])
    return Borders(distances, spacings, pixels)


def _signed_distances(positions: np.ndarray, is_own: np.ndarray, counts: np.ndarray, spacing: float) -> np.ndarray:
    """Return distances [N] to the border, world units, positive inside the object."""
    result = np.zeros(len(positions), np.float32)
    for side, sign in ((is_own, 1), (~is_own, -1)):
        others = positions[~side & counts]
        if len(others) < NEIGHBORS:
            result[side] = sign * np.inf
            continue
        found, _ = build_kd_tree(others).query(positions[side], [NEIGHBORS])
        result[side] = sign * np.maximum(found[:, 0] - EXCESS * spacing, spacing / 4)
    return result


def _spacing(positions: np.ndarray) -> float:
    """Return the median distance of points [n, 3] to their nearest neighbor."""
    samples = positions[:: len(positions) // MAX_SAMPLES + 1]
    found, _ = build_kd_tree(positions).query(samples, [2])
    return max(float(np.median(found)), float(np.finfo(np.float32).tiny))


def _pixel_size(center: np.ndarray, views: Sequence[View]) -> float:
    """Return the size of a photo's pixel at a point [3], depth over focal length: the median of the views before it."""
    sizes = []
    for camera in (view.camera for view in views):
        depth = (camera.camera_to_world[:3, 3] - center) @ camera.camera_to_world[:3, 2]  # cameras view along -z
        if depth > 0:
            sizes.append(depth / np.sqrt(camera.fx * camera.fy))
    return float(np.median(sizes)) if sizes else 1.0


class EdgedSplats:
    """A model's Gaussians by object, for edges of any shape. shares: [n, K], probabilities of the objects."""

    def __init__(
        self, gaussians: Gaussians, shares: np.ndarray, palettes: Sequence[Palette], views: Sequence[View]
    ) -> None:
        self._gaussians, self._shares, self._palettes = gaussians, shares, palettes
        self._names = [palette.name for palette in palettes]
        solid = gaussians.table[: gaussians.n_foreground]
        near = measure_borders(solid[:, :3], shares[: len(solid)], solid[:, OPACITY] > MIN_LOGIT, views)
        distances = np.full(shares.shape, -np.inf, np.float32)
        distances[: len(solid)] = near.distances
        self._borders = replace(near, distances=distances)
        # the last results, by their arguments
        self._widest: tuple[str, tuple[ObjectSplats, ...]] = ("", ())
        self._shaped: tuple[tuple[str, str], tuple[ObjectSplats, ...]] = (("", ""), ())

    def objects(
        self, edges: Mapping[str, EdgeShape], added: Mapping[str, Sequence[AddedColor]]
    ) -> tuple[ObjectSplats, ...]:
        """Return the Gaussians of each object with these edges and added colors, both by object."""
        key = repr(active_edges(edges)), repr(added)
        if self._shaped[0] != key:
            shares = apply_edges_to_points(self._shares, self._borders, self._names, edges)
            self._shaped = key, tuple(_within(own, shares[:, k]) for k, own in enumerate(self._reachable(added)))
        return self._shaped[1]

    def _reachable(self, added: Mapping[str, Sequence[AddedColor]]) -> tuple[ObjectSplats, ...]:
        """Return the Gaussians that each object could cover with any edge."""
        if not self._widest[1] or self._widest[0] != repr(added):
            is_near = self._borders.distances > -MAX_EDGE_REACH * self._borders.pixels
            reached = np.maximum(self._shares, np.where(is_near, 2 * NEGLIGIBLE, 0))
            self._widest = repr(added), splats_of_objects(self._gaussians, reached, self._palettes, added)
        return self._widest[1]


def _within(reachable: ObjectSplats, shares: np.ndarray) -> ObjectSplats:
    """Select an object's Gaussians by their shares [n]."""
    own = shares[reachable.rows]
    kept = own > NEGLIGIBLE
    return ObjectSplats(reachable.rows[kept], own[kept], reachable.weights[kept], reachable.slopes[kept])
