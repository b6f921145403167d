"""Conjugate gradients for sparse, symmetric, positive definite systems, and warnings if they do not converge."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from .progress import Emit

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


class NotConverged(UserWarning):
    """A solver stopped before it reached its tolerance; `residual` is relative to the right-hand side."""

    def __init__(self, iterations: int, residual: float, tolerance: float) -> None:
        super().__init__(
            f"Conjugate gradients have not converged: after {iterations} iterations a relative residual of "
            f"{residual:.1e} is left, and {tolerance:.0e} was the goal. What was found so far is used."
        )
        self.residual = residual


def warn_not_converged(iterations: int, residual: float, tolerance: float) -> None:
    """Warn that conjugate gradients have not converged."""
    warnings.warn(NotConverged(iterations, residual, tolerance), stacklevel=3)


@contextmanager
def convergence_as_event(emit: Emit) -> Iterator[None]:
    """Emit the worst `NotConverged` warning of the block as one event; other warnings are warned again."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", NotConverged)
        yield
    unconverged = [each.message for each in caught if isinstance(each.message, NotConverged)]
    for each in caught:
        if not isinstance(each.message, NotConverged):
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
    if unconverged:
        worst = max(unconverged, key=lambda message: message.residual)
        emit("warning", code="convergence", sentence=str(worst))
