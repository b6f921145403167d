"""The graph of neighboring surface points, and the linear solver for systems on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

NEIGHBORS = 12
PATTERN = 0.02  # what stays of a weight across a color edge: a smooth surface with a pattern is one thing
CONCAVE = 3.0  # so much more an inward turn of the normals separates: where things touch there is a crease
TOLERANCE, MOST_STEPS = 1e-4, 150  # of the linear solver; the tolerance is relative to the right-hand side


def neighbor_graph(positions: np.ndarray, lab: np.ndarray, normals: np.ndarray, grain: float) -> sparse.csr_matrix:
    """Pairwise weights between the NEIGHBORS nearest points, near 1 where color, normal and place agree.

    A crease (the normals turn towards each other) separates CONCAVE times as much as an edge: things touch in creases.

    Args:
        positions: [p, 3] grid coordinates.
        lab: [p, 3] CIE Lab.
        normals: [p, 3] of unit length, outward.
        grain: of the points, grid coordinates.

    Returns:
        Symmetric [p, p], weights in [0, 1 + 1e-6].
    """
    # the balanced build has crashed beside torch on real data; this one has not
    tree = cKDTree(positions, balanced_tree=False, compact_nodes=False)
    distances, neighbors = tree.query(positions, k=range(1, min(NEIGHBORS + 1, len(positions)) + 1))
    distances, neighbors = distances[:, 1:], neighbors[:, 1:]
    color = ((lab[neighbors] - lab[:, None]) ** 2).sum(2) / (2 * 8.0**2)
    turn = (1 - (normals[neighbors] * normals[:, None]).sum(2)) / (2 * 0.15)
    # negative where the normals turn towards each other
    bend = ((normals[neighbors] - normals[:, None]) * (positions[neighbors] - positions[:, None])).sum(2)
    turn = np.where(bend < 0, CONCAVE * turn, turn)
    place = distances**2 / (2 * (4 * grain) ** 2)
    weights = np.exp(-turn - place) * (PATTERN + (1 - PATTERN) * np.exp(-color)) + 1e-6
    rows = np.repeat(np.arange(len(positions)), neighbors.shape[1])
    graph = sparse.csr_matrix((weights.ravel(), (rows, neighbors.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T).tocsr()


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, right: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Solve A x = b for several right-hand sides at once, with the diagonal of A as preconditioner.

    Scipy's solvers take one right-hand side at a time.

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
    return x


def _dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products [c] of columns [p, c]; no array of all products is made."""
    return np.einsum("pc,pc->c", a, b)
