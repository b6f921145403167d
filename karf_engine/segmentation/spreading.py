"""How corrections change labels: corrected points are fixed, and unsure points tied to them follow.

One more linear system on the neighbor graph, for the change of the labels alone: what no stroke contradicts stays as it
is. A stroke pulls its neighbors along, and they theirs; each is held by its margin:

    (D + C) d - lambda W d = C (y - x)      C: `corrected` where corrections say something, else held * margin ** power

The right-hand side is 0 but where a correction y contradicts the labels x. Where masks or colors were mistaken margins are
small, so a change runs through such a patch and ends where labels are sure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .constraints import Constraints
from .label_propagation import PARAMETERS as PROPAGATION
from .neighbor_graph import conjugate_gradients
from .point_labels import Labels


@dataclass(frozen=True)
class SpreadParameters:
    """How far a stroke runs. docs/method.md says what was tried for strokes; none of these was varied alone on record.

    Attributes:
        corrected: Confidence of what was corrected, far above what neighbors say together.
        held: Confidence of labels without a doubt.
        least_held: Confidence of those with nothing but doubt.
        power: Of the margin: a change runs through what is unsure, and ends where labels are sure.
    """

    corrected: float = 1000.0
    held: float = 30.0
    least_held: float = 0.02
    power: float = 10.0


PARAMETERS = SpreadParameters()


def spread(labels: Labels, graph: sparse.csr_matrix, constraints: Constraints) -> Labels:
    """The labels once corrections have changed them. A stroke that agrees with them changes no other point.

    Args:
        labels: of the p points, as masks have them.
        graph: their neighbor weights, [p, p].
        constraints: those of the points by corrections.
    """
    x, fixed = labels.probabilities, constraints.fixed
    # "this is not it" leaves it to the labels so far what else it is
    wanted = constraints.targets * np.where(constraints.targets.max(1, keepdims=True) > 0.5, 1, x + 1e-3)
    wanted /= wanted.sum(1, keepdims=True)
    contradicted = fixed & (constraints.targets[np.arange(len(x)), labels.classes] == 0)
    confidence = np.where(
        fixed, PARAMETERS.corrected, PARAMETERS.least_held + PARAMETERS.held * labels.margin**PARAMETERS.power
    )
    diagonal = (PROPAGATION.smoothness * np.asarray(graph.sum(1)).ravel() + confidence)[:, None]
    right = PARAMETERS.corrected * contradicted[:, None] * (wanted - x)
    change = conjugate_gradients(
        lambda d: diagonal * d - PROPAGATION.smoothness * (graph @ d), diagonal[:, 0], right, np.zeros_like(x)
    )
    solved, opinion = (
        np.where(fixed[:, None], wanted, np.clip(each + change, 0, None) + 1e-9) for each in (x, labels.opinion)
    )
    return Labels(solved / solved.sum(1, keepdims=True), labels.precision, opinion / opinion.sum(1, keepdims=True))
