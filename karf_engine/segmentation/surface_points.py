"""Merge the samples of many rays to surface points, in cells slightly larger than a voxel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch

from ..io.color import srgb_to_lab
from .views import CachedViews

CELL_IN_SPACINGS = 1.4
MAX_POINTS = 60_000  # approximate; with more points each has few votes
LABEL_SAMPLES = 3  # per ray; the first and last of many samples are off the surface


@dataclass(frozen=True)
class SurfacePoints:
    """p surface points, merged from the samples of n rays.

    Attributes:
        positions: [p, 3] grid coordinates.
        lab: [p, 3] photo colors in CIE Lab, L in [0, 100].
        point_of_sample: [n, K] int, the point of each sample of each ray.
        spacing: approximate distance of the points, grid coordinates; the unit of lengths in label propagation.
    """

    positions: np.ndarray
    lab: np.ndarray
    point_of_sample: np.ndarray
    spacing: float

    def __len__(self) -> int:
        return len(self.positions)


def surface_points(cached: CachedViews, voxel: float) -> SurfacePoints:
    """Return surface points as fine as the field's voxels (grid coordinates), but not many more than MOST_POINTS."""
    points = _points_of_spacing(cached, voxel)
    if len(points) <= MAX_POINTS:
        return points
    return _points_of_spacing(cached, voxel * math.sqrt(len(points) / MAX_POINTS))


def _points_of_spacing(cached: CachedViews, spacing: float) -> SurfacePoints:
    cache = cached.cache.subsample(LABEL_SAMPLES)
    lab = srgb_to_lab(cached.views.colors()[cache.index.cpu().numpy()])
    # a silhouette ray has spread samples and a mixed color
    confidence = torch.exp(-cache.spread / (4 * spacing)) * cache.opacity
    return merge_samples(cache.positions.cpu().numpy(), lab, confidence.cpu().numpy(), spacing)


def merge_samples(positions: np.ndarray, lab: np.ndarray, ray_confidence: np.ndarray, spacing: float) -> SurfacePoints:
    """Merge the samples of rays in cells of 1.4 point spacings.

    Args:
        positions: [n, K, 3] samples, grid coordinates.
        lab: [n, 3] photo colors of the rays.
        ray_confidence: [n] in [0, 1], weights of the means; low for silhouette rays, whose colors are mixtures.
        spacing: of the points, grid coordinates.
    """
    n_rays, n_samples = positions.shape[:2]
    flat = positions.reshape(-1, 3)
    cells = np.floor((flat - flat.min(0)) / (CELL_IN_SPACINGS * spacing)).astype(np.int64)
    extent = cells.max(0) + 1
    keys = (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]
    _, point = np.unique(keys, return_inverse=True)
    point = point.ravel()
    n_points = int(point.max()) + 1
    weight = np.repeat(np.maximum(ray_confidence, 1e-4), n_samples)
    total = np.bincount(point, weight, n_points)

    def mean(values: np.ndarray) -> np.ndarray:
        sums = [np.bincount(point, weight * values[:, axis], n_points) for axis in range(values.shape[1])]
        return np.stack(sums, 1) / total[:, None]

    return SurfacePoints(mean(flat), mean(np.repeat(lab, n_samples, 0)), point.reshape(n_rays, n_samples), spacing)
