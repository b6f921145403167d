"""Surface points: the samples of many rays merged into cells a little larger than a grain, mostly a voxel.

A point knows its mean position and mean photo color in CIE Lab. `point_of_sample` [n, K]
says into which point each cached sample went.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CELL_IN_GRAINS = 1.4


@dataclass(frozen=True)
class SurfacePoints:
    """positions [p, 3] grid coordinates; lab [p, 3] (L in [0, 100]); point_of_sample [n, K] int.

    grain: how fine the points are, grid coordinates; lengths of the label solve are multiples of it.
    """

    positions: np.ndarray
    lab: np.ndarray
    point_of_sample: np.ndarray
    grain: float

    def __len__(self) -> int:
        return len(self.positions)


def merge_samples(positions: np.ndarray, lab: np.ndarray, ray_confidence: np.ndarray, grain: float) -> SurfacePoints:
    """Merge samples [n, K, 3] of rays with photo colors lab [n, 3] and confidences [n] in [0, 1] in cells of 1.4 grains.

    A ray whose samples lie far apart (a silhouette) should come with low confidence: its color is a mixture.
    """
    n_rays, n_samples = positions.shape[:2]
    flat = positions.reshape(-1, 3)
    cells = np.floor((flat - flat.min(0)) / (CELL_IN_GRAINS * grain)).astype(np.int64)
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

    return SurfacePoints(mean(flat), mean(np.repeat(lab, n_samples, 0)), point.reshape(n_rays, n_samples), grain)
