"""Sparse, symmetric, positive definite systems of one photo's pixels."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from .convergence import warn_not_converged

TOLERANCE = 1e-3  # of the residual, relative to the right-hand side; coverage is stored in 8 bits (not varied)


def solve(
    system: sparse.csr_array, right_hand_side: np.ndarray, start: np.ndarray, iterations: int | None = None
) -> np.ndarray:
    """Solve by conjugate gradients with the diagonal as preconditioner; warns where they do not converge.

    Args:
        system: [n, n].
        right_hand_side: [n].
        start: [n], a guess of the solution.
        iterations: At most; by default ten for each unknown, as scipy has it.

    Returns:
        [n].
    """
    precondition = sparse.diags_array(1 / system.diagonal())
    solved, unconverged = cg(system, right_hand_side, x0=start, rtol=TOLERANCE, maxiter=iterations, M=precondition)
    if unconverged:  # scipy's number of iterations; 0 where they converge
        residual = np.linalg.norm(right_hand_side - system @ solved) / np.linalg.norm(right_hand_side)
        warn_not_converged(unconverged, float(residual), TOLERANCE)
    return solved
