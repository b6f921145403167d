"""A solver that has not converged says so, as a warning of Python or as an event of a stage."""

import warnings

import numpy as np
import pytest
from scipy import sparse

from karf_engine.compute import sparse_systems
from karf_engine.compute.sparse_systems import NotConverged, convergence_as_event, warn_not_converged
from karf_engine.segmentation import label_propagation

N = 200


def chain() -> sparse.csr_array:
    """A positive definite chain of N unknowns: what one end says takes as many iterations to reach the other."""
    return sparse.csr_array(sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(N, N)))


def one_end() -> np.ndarray:
    return np.eye(N)[0]


def test_a_system_of_a_photo_that_cannot_be_solved_in_its_iterations_warns_with_residual_and_iterations():
    with pytest.warns(NotConverged, match=r"after 5 iterations a relative residual of [0-9.]+e"):
        sparse_systems.solve(chain(), one_end(), np.zeros(N), iterations=5)


def test_a_system_of_a_photo_that_is_solved_does_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = sparse_systems.solve(chain(), one_end(), np.zeros(N))
    assert np.linalg.norm(chain() @ found - one_end()) <= sparse_systems.TOLERANCE


def test_a_system_of_surface_points_warns_too(monkeypatch):
    def solve():
        system = chain()
        right = one_end()[:, None]
        return label_propagation.conjugate_gradients(lambda x: system @ x, np.full(N, 2.0), right, np.zeros((N, 1)))

    monkeypatch.setattr(label_propagation, "MAX_STEPS", 5)
    with pytest.warns(NotConverged, match="after 5 iterations"):
        solve()
    monkeypatch.setattr(label_propagation, "MAX_STEPS", 2 * N)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solve()


def test_a_stage_emits_the_worst_of_them_and_leaves_other_warnings_as_they_are():
    events = []
    with (
        pytest.warns(UserWarning, match="something else"),
        convergence_as_event(lambda *a, **k: events.append((a, k))),
    ):
        warn_not_converged(5, 0.02, 1e-3)
        warn_not_converged(5, 0.25, 1e-3)
        warnings.warn("something else", UserWarning, stacklevel=1)
    (((name,), event),) = events
    assert (name, event["code"]) == ("warning", "convergence") and "2.5e-01" in event["sentence"]
