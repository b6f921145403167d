"""How corrections change labels: what they say holds, and what lies near, looks alike and was unsure follows.

One more linear system on the neighbor graph, whose unary terms are the labels so far. They are held with a confidence of
their margin, and less round a stroke that contradicts them, as far as colors are those of the stroke:

    (D + C) x - lambda W x = C y        C: FIRM where corrections say something, else HELD * margin * (1 - influence)

The influence of a stroke reaches as far as it is large, so that a slip of the hand changes little.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .constraints import Constraints
from .label_propagation import SMOOTHNESS, Labels
from .neighbor_graph import conjugate_gradients
from .surface_points import SurfacePoints

FIRM = 1000.0  # confidence of what was corrected, far above what neighbors say together
HELD, LEAST_HELD = 5.0, 0.02  # confidence of labels without a margin of doubt, and of none
REACH = 1.0  # of a stroke, in its radii
ALIKE = 8.0  # Lab units
GAP = 4.0  # grains between points of one stroke
NEAREST = 8  # points of a stroke that others are compared with


def spread(
    labels: Labels,
    points: SurfacePoints,
    graph: sparse.csr_matrix,
    constraints: Constraints,
    start: np.ndarray | None = None,
) -> Labels:
    """The labels once corrections have changed them.

    Args:
        labels: of the p points, as masks have them.
        points: their places and colors.
        graph: their neighbor weights, [p, p].
        constraints: what corrections say of them.
        start: a solution that is near, [p, K+1].
    """
    x, fixed = labels.probabilities, constraints.fixed
    # "this is not it" leaves it to the labels so far what else it is
    wanted = constraints.targets * np.where(constraints.targets.max(1, keepdims=True) > 0.5, 1, x + 1e-3)
    wanted /= wanted.sum(1, keepdims=True)
    contradicted = fixed & (constraints.targets[np.arange(len(x)), labels.classes] == 0)
    held = LEAST_HELD + HELD * labels.margin * (1 - _influence(points, contradicted))
    confidence = np.where(fixed, FIRM, held)
    diagonal = SMOOTHNESS * np.asarray(graph.sum(1)).ravel() + confidence
    right = confidence[:, None] * np.where(fixed[:, None], wanted, x)
    solved = conjugate_gradients(
        lambda v: diagonal[:, None] * v - SMOOTHNESS * (graph @ v), diagonal, right, x if start is None else start
    )
    solved = (np.clip(solved, 0, None) + 1e-9) * (~fixed[:, None] | (constraints.targets > 0))
    return Labels(solved / solved.sum(1, keepdims=True), labels.precision)


def _influence(points: SurfacePoints, contradicted: np.ndarray) -> np.ndarray:
    """How far each point is like a stroke that contradicts the labels, and near it, [p] in [0, 1]."""
    if not contradicted.any():
        return np.zeros(len(points))
    positions, lab = points.positions[contradicted], points.lab[contradicted]
    tree = cKDTree(positions)
    reach = REACH * np.maximum(
        _radii(positions, tree.query_pairs(GAP * points.grain, output_type="ndarray")), points.grain
    )
    distance, nearest = tree.query(points.positions, k=range(1, min(NEAREST, len(positions)) + 1))
    color = ((points.lab[:, None] - lab[nearest]) ** 2).sum(2)
    return (np.exp(-color / (2 * ALIKE**2)) * np.exp(-((distance / reach[nearest]) ** 2))).max(1)


def _radii(positions: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """RMS radius of the stroke that each of n points belongs to, [n]; pairs: [m, 2] of points of one stroke."""
    n = len(positions)
    links = sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    count, stroke = connected_components(links, directed=False)
    sizes = np.bincount(stroke, minlength=count)
    centers = np.stack([np.bincount(stroke, axis, count) for axis in positions.T], 1) / sizes[:, None]
    squares = ((positions - centers[stroke]) ** 2).sum(1)
    return np.sqrt(np.bincount(stroke, squares, count) / sizes)[stroke]
