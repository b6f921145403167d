"""Find the seeds of an object: surface points that the masks confidently assign to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compute.neighbors import build_kd_tree

if TYPE_CHECKING:
    from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]


def has_seeds(seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Return whether each object has a seed, [K] bool; arguments as for `label_propagation.propagate_labels`."""
    objects = range(1, seed_targets.shape[1])
    return np.array([seeds_of(k, seed_targets, seed_confidence).any() for k in objects])


def seeds_of(k: int, seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Return True for the seeds of class k, [p]."""
    # votes of 0.5 and less may be open: far points gather many of them
    votes = seed_confidence * seed_targets[:, k] * (seed_targets[:, k] > 0.5)
    return votes >= np.maximum(0.25 * votes.max(initial=0), np.finfo(float).tiny)


def seed_regions(
    positions: np.ndarray, spacing: float, seed_targets: np.ndarray, seed_confidence: np.ndarray
) -> tuple[list[cKDTree], np.ndarray]:
    """Return a search tree of each object's seeds, and their RMS radii [K], at least the point spacing."""
    trees, radii = [], []
    for k in range(1, seed_targets.shape[1]):
        seeds = positions[seeds_of(k, seed_targets, seed_confidence)]
        trees.append(build_kd_tree(seeds, balanced_tree=False, compact_nodes=False))
        radii.append(np.sqrt(((seeds - seeds.mean(0)) ** 2).sum(1).mean()) if len(seeds) else 0)
    return trees, np.maximum(radii, spacing)
