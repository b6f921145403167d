"""Iterative solvers say where they stopped before they reached their tolerance."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from .progress import Emit


class NotConverged(UserWarning):
    """A solver has stopped before its tolerance; what it has found so far is used.

    Attributes:
        residual: Norm of what is left, relative to the right-hand side's.
    """

    def __init__(self, iterations: int, residual: float, tolerance: float) -> None:
        """See `warn_not_converged`."""
        super().__init__(
            f"Conjugate gradients have not converged: after {iterations} iterations a relative residual of "
            f"{residual:.1e} is left, and {tolerance:.0e} was the goal. What was found so far is used."
        )
        self.residual = residual


def warn_not_converged(iterations: int, residual: float, tolerance: float) -> None:
    """Warn that conjugate gradients have not converged.

    Args:
        iterations: That were done.
        residual: Norm of what is left, relative to the right-hand side's.
        tolerance: Which the residual should have reached.
    """
    warnings.warn(NotConverged(iterations, residual, tolerance), stacklevel=3)


@contextmanager
def convergence_as_event(emit: Emit) -> Iterator[None]:
    """Emit the worst of the `NotConverged` warned of in here as one event of the stage; other warnings stay."""
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
