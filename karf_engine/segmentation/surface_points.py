"""Surface points, merged from the samples of many rays; their labels, and how unsure the labels of each object are.

Labels are unsure where no marked view shows the object, or where masks and colors disagree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from ..io.color import srgb_to_lab
from ..io.files import atomic_write
from ..io.npz import read_arrays
from .views import CachedViews

CELL_IN_SPACINGS = 1.4
MAX_POINTS = 60_000  # approximate; with more points each has few votes
LABEL_SAMPLES = 3  # per ray; the first and last of many samples are off the surface
DOUBTED = 0.3  # doubt above which a point is unsure; 1/3 is one of three opinions
AGAIN = "Run the segmentation stage again."


@dataclass(frozen=True)
class SurfacePoints:
    """p surface points, merged from the samples of n rays."""

    positions: np.ndarray  # [p, 3] grid coordinates
    lab: np.ndarray  # [p, 3] photo colors in CIE Lab, L in [0, 100]
    point_of_sample: np.ndarray  # [n, K] int
    spacing: float  # approximate distance of the points, grid coordinates

    def __len__(self) -> int:
        return len(self.positions)


def surface_points(cached: CachedViews, voxel: float) -> SurfacePoints:
    """Return surface points as fine as the field's voxels (grid coordinates), but not many more than MAX_POINTS."""
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
    """Merge the samples [n, K, 3] of rays with colors [n, 3] in cells of 1.4 spacings; ray_confidence weighs the means."""
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


@dataclass(frozen=True)
class Labels:
    """Labels of p surface points."""

    probabilities: np.ndarray  # [p, K+1]; rows sum to 1
    precision: np.ndarray  # [K] in [0, 1], share of the seeds of an object's color that the masks assign to the object
    opinion: np.ndarray  # [p, K+1], mean of the labels from masks, from colors and from both

    @property
    def classes(self) -> np.ndarray:
        """The likeliest class of each point, [p] int."""
        return self.probabilities.argmax(1)

    @property
    def margin(self) -> np.ndarray:
        """The difference between the two largest probabilities of each point, [p] in [0, 1]."""
        return margin(self.probabilities)

    @property
    def doubt(self) -> np.ndarray:
        """The disagreement of `opinion` with the labels, [p, K] in [0, 1]; high where labels are likely wrong."""
        is_it = self.classes[:, None] == np.arange(1, self.opinion.shape[1])
        return np.where(is_it, 1 - self.opinion[:, 1:], self.opinion[:, 1:])


def margin(x: np.ndarray) -> np.ndarray:
    """Return the difference between the two largest values of each row, [p]."""
    top_two = np.sort(x, 1)[:, -2:]
    return top_two[:, 1] - top_two[:, 0]


@dataclass(frozen=True)
class ObjectDoubt:
    """The doubt of one object."""

    share: float  # of unsure points among these and the object's, in [0, 1]
    unseen: float  # share of the unsure points that no marked view shows

    def sentence(self, name: str) -> str:
        if self.unseen > 0.5:
            return f"{self.share:.0%} of {name!r} is unsure, most of it where no marked photo shows it."
        return f"{self.share:.0%} of {name!r} is unsure, most of it where masks and colors contradict each other."


def unsure_objects(cached: CachedViews, points: SurfacePoints, labels: Labels) -> dict[str, ObjectDoubt]:
    """Return the doubt of each object by name. `points` come from the rays of `cached`, `labels` are theirs."""
    views = cached.views
    has_masks = np.repeat([bool(masks) for masks in views.masks], np.diff(views.offsets))
    from_masked = points.point_of_sample[has_masks[cached.cache.index.cpu().numpy()]]
    is_seen = np.bincount(from_masked.ravel(), minlength=len(points)) > 0
    found = {}
    for k, name in enumerate(views.objects, 1):
        unsure = labels.doubt[:, k - 1] > DOUBTED
        n_unsure, n_points = unsure.sum(), (unsure | (labels.classes == k)).sum()
        shares = n_unsure / max(n_points, 1), (unsure & ~is_seen).sum() / max(n_unsure, 1)
        found[name] = ObjectDoubt(*(round(float(share), 4) for share in shares))
    return found


@dataclass(frozen=True)
class SurfaceUncertainty:
    """The doubt of p surface points."""

    objects: Sequence[str]
    positions: np.ndarray  # [p, 3] float32, world coordinates
    doubts: np.ndarray  # [p, K] uint8, 255 is full doubt; see `Labels.doubt`

    def at(self, positions: np.ndarray) -> np.ndarray:
        """Return the doubt of the nearest points, [n, K] in [0, 1], for world positions [n, 3]."""
        tree = build_kd_tree(self.positions, balanced_tree=False, compact_nodes=False)
        return self.doubts[tree.query(positions)[1]] / np.float32(255)

    def write(self, path: Path) -> None:
        arrays = {"objects": np.array(self.objects, np.str_), "positions": self.positions, "doubts": self.doubts}
        atomic_write(path, lambda temporary: np.savez_compressed(temporary, **arrays))

    @classmethod
    def read(cls, path: Path) -> SurfaceUncertainty:
        """Read what `write` wrote. Raises DataError where the file is missing or damaged."""
        objects, positions, doubts = read_arrays(path, ["objects", "positions", "doubts"], "doubts", AGAIN)
        fits = positions.ndim == 2 and positions.shape[1] == 3 and doubts.shape == (len(positions), len(objects))
        if not (fits and len(positions) and positions.dtype == np.float32 and np.isfinite(positions).all()):
            raise DataError(f"{path} has points {positions.shape} and doubts {doubts.shape}.", AGAIN)
        if objects.dtype.kind != "U" or doubts.dtype != np.uint8:
            raise DataError(f"{path} has doubts of {doubts.dtype} of objects of {objects.dtype}.", AGAIN)
        return cls(objects.tolist(), positions, doubts)
