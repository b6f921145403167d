"""Distances of points and Gaussians to the borders of objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..capture.capture import View
from ..compute.neighbors import build_kd_tree
from ..palettes.edge_shape import Borders

# The border is at the third nearest point of the other side, since single points may be outliers. On evenly spaced points
# this distance exceeds that of the border by 0.75 spacings.
NEIGHBORS, EXCESS = 3, 0.75
MAX_SAMPLES = 5000  # points per object that the spacing is measured at


def measure_borders(positions: np.ndarray, shares: np.ndarray, counts: np.ndarray, views: Sequence[View]) -> Borders:
    """Measure the distance of points [N, 3] to the objects' borders.

    shares: [N, K], probabilities of the objects. counts: [N] bool, points that form borders. views: for the size of a
    pixel.
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
