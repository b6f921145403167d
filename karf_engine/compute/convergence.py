"""Warnings of iterative solvers that stop before they reach their tolerance."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from .progress import Emit


class NotConverged(UserWarning):
    """A solver stopped before it reached its tolerance; its last iterate is used.

    Attributes:
        residual: Norm of the residual relative to the right-hand side.
    """

    def __init__(self, iterations: int, residual: float, tolerance: float) -> None:
        super().__init__(
            f"Conjugate gradients have not converged: after {iterations} iterations a relative residual of "
            f"{residual:.1e} is left, and {tolerance:.0e} was the goal. What was found so far is used."
        )
        self.residual = residual


def warn_not_converged(iterations: int, residual: float, tolerance: float) -> None:
    """Warn that conjugate gradients have not converged; residual and tolerance are relative to the right-hand side."""
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
