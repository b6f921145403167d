"""How corrections change labels: what they say holds, and what is tied to it and was unsure follows.

One more linear system on the neighbor graph, for the change of the labels alone: what no stroke contradicts stays as it
is. A stroke pulls its neighbors along, and they theirs; each is held by its margin:

    (D + C) d - lambda W d = C (y - x)      C: FIRM where corrections say something, else HELD * margin ** POWER

The right-hand side is 0 but where a correction y contradicts the labels x. Where masks or colors were mistaken margins are
small, so a change runs through such a patch and ends where labels are sure.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from .constraints import Constraints
from .label_propagation import SMOOTHNESS
from .neighbor_graph import conjugate_gradients
from .point_labels import Labels

FIRM = 1000.0  # confidence of what was corrected, far above what neighbors say together
HELD, LEAST_HELD = 30.0, 0.02  # confidence of labels without a doubt, and of those with nothing else
POWER = 10.0  # of the margin: a change runs through what is unsure, and ends where labels are


def spread(labels: Labels, graph: sparse.csr_matrix, constraints: Constraints) -> Labels:
    """The labels once corrections have changed them. A stroke that says what they show already changes no other point.

    Args:
        labels: of the p points, as masks have them.
        graph: their neighbor weights, [p, p].
        constraints: what corrections say of them.
    """
    x, fixed = labels.probabilities, constraints.fixed
    # "this is not it" leaves it to the labels so far what else it is
    wanted = constraints.targets * np.where(constraints.targets.max(1, keepdims=True) > 0.5, 1, x + 1e-3)
    wanted /= wanted.sum(1, keepdims=True)
    contradicted = fixed & (constraints.targets[np.arange(len(x)), labels.classes] == 0)
    confidence = np.where(fixed, FIRM, LEAST_HELD + HELD * labels.margin**POWER)
    diagonal = (SMOOTHNESS * np.asarray(graph.sum(1)).ravel() + confidence)[:, None]
    right = FIRM * contradicted[:, None] * (wanted - x)
    change = conjugate_gradients(
        lambda d: diagonal * d - SMOOTHNESS * (graph @ d), diagonal[:, 0], right, np.zeros_like(x)
    )
    solved, opinion = (
        np.where(fixed[:, None], wanted, np.clip(each + change, 0, None) + 1e-9) for each in (x, labels.opinion)
    )
    return Labels(solved / solved.sum(1, keepdims=True), labels.precision, opinion / opinion.sum(1, keepdims=True))
