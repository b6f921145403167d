"""Seeds of an object: surface points that the masks confidently call it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..compute.neighbors import tree_of


def has_seeds(seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Whether each object has a confident seed, [K] bool; arguments as for `label_propagation.propagate_labels`."""
    objects = range(1, seed_targets.shape[1])
    return np.array([seeds_of(k, seed_targets, seed_confidence).any() for k in objects])


def seeds_of(k: int, seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """True for the confident seeds of class k, [p]."""
    # only among its own: a point far away gathers many votes, half of which may be for an object not marked there
    strength = seed_confidence * seed_targets[:, k] * (seed_targets[:, k] > 0.5)
    firm = np.maximum(0.25 * strength.max(initial=0), np.finfo(float).tiny)  # what has no confidence is not a seed
    return strength >= firm


def seed_regions(
    positions: np.ndarray, spacing: float, seed_targets: np.ndarray, seed_confidence: np.ndarray
) -> tuple[list[cKDTree], np.ndarray]:
    """For each object a search tree of its confident seeds, and their RMS radius, at least a point spacing: one may be all."""
    trees, radii = [], []
    for k in range(1, seed_targets.shape[1]):
        seeds = positions[seeds_of(k, seed_targets, seed_confidence)]
        trees.append(tree_of(seeds, balanced_tree=False, compact_nodes=False))
        radii.append(np.sqrt(((seeds - seeds.mean(0)) ** 2).sum(1).mean()) if len(seeds) else 0)
    return trees, np.maximum(radii, spacing)
