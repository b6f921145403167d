"""Measure how unsure the labels of each object are: where no marked view shows it, or masks and colors disagree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..compute.neighbors import build_kd_tree
from ..errors import DataError
from ..io.files import atomic_write
from ..io.npz import read_arrays
from .point_labels import Labels
from .surface_points import SurfacePoints
from .views import CachedViews

DOUBTED = 0.3  # doubt above which a point is unsure; 1/3 is one of three opinions
AGAIN = "Run the segmentation stage again."


@dataclass(frozen=True)
class ObjectDoubt:
    """The doubt of one object.

    Attributes:
        share: of unsure points among these and the object's, in [0, 1].
        unseen: share of the unsure points that no marked view shows, in [0, 1].
    """

    share: float
    unseen: float

    def sentence(self, name: str) -> str:
        """Return the sentence for the user."""
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
    """The doubt of p surface points.

    Attributes:
        objects: names of the K objects.
        positions: [p, 3] float32, world coordinates.
        doubts: [p, K] uint8, 255 is full doubt; see `Labels.doubt`.
    """

    objects: Sequence[str]
    positions: np.ndarray
    doubts: np.ndarray

    def at(self, positions: np.ndarray) -> np.ndarray:
        """Return the doubt of the nearest points, [n, K] in [0, 1], for world positions [n, 3]."""
        tree = build_kd_tree(self.positions, balanced_tree=False, compact_nodes=False)
        return self.doubts[tree.query(positions)[1]] / np.float32(255)

    def write(self, path: Path) -> None:
        """Write the doubts atomically."""
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
