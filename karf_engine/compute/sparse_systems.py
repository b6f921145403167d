"""Conjugate gradients for sparse, symmetric, positive definite systems of a photo's pixels."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from .convergence import warn_not_converged

TOLERANCE = 1e-3  # residual relative to the right-hand side; coverage is stored in 8 bits


def solve(
    system: sparse.csr_array, right_hand_side: np.ndarray, start: np.ndarray, iterations: int | None = None
) -> np.ndarray:
    """Solve a system [n, n] by conjugate gradients with a Jacobi preconditioner, from an initial guess [n].

    Warns if they do not converge within `iterations`, by default SciPy's 10 n.
    """
    precondition = sparse.diags_array(1 / system.diagonal())
    solved, unconverged = cg(system, right_hand_side, x0=start, rtol=TOLERANCE, maxiter=iterations, M=precondition)
    if unconverged:  # number of iterations; 0 on success
        residual = np.linalg.norm(right_hand_side - system @ solved) / np.linalg.norm(right_hand_side)
        warn_not_converged(unconverged, float(residual), TOLERANCE)
    return solved
