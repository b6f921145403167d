"""The graph of neighboring surface points, and the linear solver for systems on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from ..compute.convergence import warn_not_converged
from ..compute.neighbors import tree_of

TOLERANCE, MOST_STEPS = 1e-4, 150  # of the linear solver; the tolerance is relative to the right-hand side


@dataclass(frozen=True)
class GraphParameters:
    """What ties surface points. None of them has been varied on record; docs/method.md says what they are for.

    Attributes:
        neighbors: Of each point.
        pattern: What stays of a weight across a color edge: a smooth surface with a pattern is one thing.
        concave: How many times more an inward turn of the normals separates: where things touch there is a crease.
        color_deviation: Lab units; a difference of this much leaves exp(-1/2) of what edges take.
        turn_scale: 1 minus the cosine between normals that leaves exp(-1/2) of a weight.
        place_deviation: Likewise, in point spacings.
        least: Of every weight.
    """

    neighbors: int = 12
    pattern: float = 0.02
    concave: float = 3.0
    color_deviation: float = 8.0
    turn_scale: float = 0.15
    place_deviation: float = 4
    least: float = 1e-6


PARAMETERS = GraphParameters()


def neighbor_graph(positions: np.ndarray, lab: np.ndarray, normals: np.ndarray, spacing: float) -> sparse.csr_matrix:
    """Pairwise weights between the nearest points, near 1 where color, normal and place agree.

    A crease (the normals turn towards each other) separates more than an edge: things touch in creases.

    Args:
        positions: [p, 3] grid coordinates.
        lab: [p, 3] CIE Lab.
        normals: [p, 3] of unit length, outward.
        spacing: of the points, grid coordinates.

    Returns:
        Symmetric [p, p], weights in [0, 1 + 1e-6].
    """
    # the balanced build has crashed together with torch on real data; this one has not
    tree = tree_of(positions, balanced_tree=False, compact_nodes=False)
    distances, neighbors = tree.query(positions, k=range(1, min(PARAMETERS.neighbors + 1, len(positions)) + 1))
    distances, neighbors = distances[:, 1:], neighbors[:, 1:]
    color = ((lab[neighbors] - lab[:, None]) ** 2).sum(2) / (2 * PARAMETERS.color_deviation**2)
    turn = (1 - (normals[neighbors] * normals[:, None]).sum(2)) / (2 * PARAMETERS.turn_scale)
    # negative where the normals turn towards each other
    bend = ((normals[neighbors] - normals[:, None]) * (positions[neighbors] - positions[:, None])).sum(2)
    turn = np.where(bend < 0, PARAMETERS.concave * turn, turn)
    place = distances**2 / (2 * (PARAMETERS.place_deviation * spacing) ** 2)
    weights = (
        np.exp(-turn - place) * (PARAMETERS.pattern + (1 - PARAMETERS.pattern) * np.exp(-color)) + PARAMETERS.least
    )
    rows = np.repeat(np.arange(len(positions)), neighbors.shape[1])
    graph = sparse.csr_matrix((weights.ravel(), (rows, neighbors.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T).tocsr()


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, right: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Solve A x = b for several right-hand sides at once, with the diagonal of A as preconditioner.

    Scipy's solvers take one right-hand side at a time. Warns where they do not converge in MOST_STEPS iterations.

    Args:
        product: A times [p, c]; A is positive definite.
        diagonal: of A, [p].
        right: b, [p, c].
        x: where to start, [p, c].

    Returns:
        x [p, c].
    """
    inverse = 1 / diagonal[:, None]
    x, residual = x.copy(), right - product(x)
    scaled = residual * inverse
    direction = scaled.copy()
    energy = _dots(residual, scaled)
    goal = TOLERANCE * np.sqrt(_dots(right, right))
    for _ in range(MOST_STEPS):
        if (np.sqrt(_dots(residual, residual)) <= goal).all():
            break
        image = product(direction)
        length = energy / np.maximum(_dots(direction, image), 1e-30)
        x += length * direction
        image *= length
        residual -= image
        np.multiply(residual, inverse, out=scaled)
        new_energy = _dots(residual, scaled)
        direction *= new_energy / np.maximum(energy, 1e-30)
        direction += scaled
        energy = new_energy
    left = np.sqrt(_dots(residual, residual))
    if (left > goal).any():
        norms = np.sqrt(_dots(right, right))
        warn_not_converged(MOST_STEPS, float((left / np.maximum(norms, np.finfo(float).tiny)).max()), TOLERANCE)
    return x


def _dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products [c] of columns [p, c]; no array of all products is made."""
    return np.einsum("pc,pc->c", a, b)
