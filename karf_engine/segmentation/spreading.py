"""Spread corrections over the surface: corrected points are fixed, and unsure points tied to them follow.

A linear system on the neighbor graph gives the change d of the labels x. A stroke pulls its neighbors along, and they
theirs; each resists by its margin:

    (D + C) d - lambda W d = C (y - x)      C: CORRECTED at corrections, else LEAST_HELD + HELD * margin ** POWER

The right-hand side is 0 except where a correction y contradicts the labels. Wrong labels mostly have small margins, so a
change runs through such a patch and stops where labels are sure.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from .constraints import Constraints
from .label_propagation import SMOOTHNESS
from .neighbor_graph import conjugate_gradients
from .point_labels import Labels

CORRECTED = 1000.0  # confidence of corrections, far above what all neighbors weigh
HELD, LEAST_HELD = 30.0, 0.02  # confidence of labels without a doubt, and in full doubt
POWER = 10.0  # of the margin


def spread(labels: Labels, graph: sparse.csr_matrix, constraints: Constraints) -> Labels:
    """Return the labels changed by corrections. A stroke that agrees with the labels changes no other point.

    Args:
        labels: of p points, from the masks.
        graph: [p, p] neighbor weights.
        constraints: of the points, from the corrections.
    """
    x, fixed = labels.probabilities, constraints.fixed
    # if a stroke only excludes classes, the labels so far decide among the others
    wanted = constraints.targets * np.where(constraints.targets.max(1, keepdims=True) > 0.5, 1, x + 1e-3)
    wanted /= wanted.sum(1, keepdims=True)
    contradicted = fixed & (constraints.targets[np.arange(len(x)), labels.classes] == 0)
    confidence = np.where(fixed, CORRECTED, LEAST_HELD + HELD * labels.margin**POWER)
    diagonal = (SMOOTHNESS * np.asarray(graph.sum(1)).ravel() + confidence)[:, None]
    right = CORRECTED * contradicted[:, None] * (wanted - x)
    change = conjugate_gradients(
        lambda d: diagonal * d - SMOOTHNESS * (graph @ d), diagonal[:, 0], right, np.zeros_like(x)
    )
    solved, opinion = (
        np.where(fixed[:, None], wanted, np.clip(each + change, 0, None) + 1e-9) for each in (x, labels.opinion)
    )
    return Labels(solved / solved.sum(1, keepdims=True), labels.precision, opinion / opinion.sum(1, keepdims=True))
