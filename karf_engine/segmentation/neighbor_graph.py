"""Build the graph of neighboring surface points, and solve linear systems on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from ..compute.neighbors import build_kd_tree
from ..compute.sparse_systems import warn_not_converged

TOLERANCE, MAX_STEPS = 1e-4, 150  # of conjugate gradients; relative to the right-hand side

NEIGHBORS = 12
COLOR_DEVIATION = 8.0  # Lab units
TURN_SCALE = 0.15  # 1 minus the cosine between normals; a turn of this size multiplies a weight by exp(-1/2)
DISTANCE_DEVIATION = 4  # point spacings
PATTERN = 0.02  # share of a weight that a color edge leaves: a smooth surface with a pattern is one object
CREASE_FACTOR = 3.0  # on concave turns: objects touch in creases
MIN_WEIGHT = 1e-6


def neighbor_graph(positions: np.ndarray, lab: np.ndarray, normals: np.ndarray, spacing: float) -> sparse.csr_matrix:
    """Return weights between nearest neighbors, near 1 where color, normal and position agree: symmetric [p, p].

    positions, lab (CIE Lab), normals (outward): [p, 3]. spacing: of the points, grid coordinates.
    """
    # building a balanced tree has crashed together with torch
    tree = build_kd_tree(positions, balanced_tree=False, compact_nodes=False)
    distances, neighbors = tree.query(positions, k=range(1, min(NEIGHBORS + 1, len(positions)) + 1))
    distances, neighbors = distances[:, 1:], neighbors[:, 1:]
    color = ((lab[neighbors] - lab[:, None]) ** 2).sum(2) / (2 * COLOR_DEVIATION**2)
    turn = (1 - (normals[neighbors] * normals[:, None]).sum(2)) / (2 * TURN_SCALE)
    bend = ((normals[neighbors] - normals[:, None]) * (positions[neighbors] - positions[:, None])).sum(2)
    turn = np.where(bend < 0, CREASE_FACTOR * turn, turn)  # negative: the normals turn towards each other
    place = distances**2 / (2 * (DISTANCE_DEVIATION * spacing) ** 2)
    weights = np.exp(-turn - place) * (PATTERN + (1 - PATTERN) * np.exp(-color)) + MIN_WEIGHT
    rows = np.repeat(np.arange(len(positions)), neighbors.shape[1])
    graph = sparse.csr_matrix((weights.ravel(), (rows, neighbors.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T).tocsr()


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, right: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Solve A x = b for several right-hand sides [p, c] at once, preconditioned with the diagonal of A.

    product: maps [p, c] to A times it; A is positive definite. x: initial guess. Warns if it has not converged after
    MAX_STEPS iterations. (SciPy's solvers take one right-hand side at a time.)
    """
    inverse = 1 / diagonal[:, None]
    x, residual = x.copy(), right - product(x)
    scaled = residual * inverse
    direction = scaled.copy()
    energy = _dots(residual, scaled)
    goal = TOLERANCE * np.sqrt(_dots(right, right))
    for _ in range(MAX_STEPS):
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
        warn_not_converged(MAX_STEPS, float((left / np.maximum(norms, np.finfo(float).tiny)).max()), TOLERANCE)
    return x


def _dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products [c] of columns [p, c] without a temporary array."""
    return np.einsum("pc,pc->c", a, b)
