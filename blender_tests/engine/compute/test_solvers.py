"""Nearest neighbors where denormal numbers are flushed to zero, and solvers that say so if they have not converged."""

import math
import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy import sparse

torch = pytest.importorskip("torch")

from karf_engine.compute import sparse_systems
from karf_engine.compute.neighbors import build_kd_tree
from karf_engine.compute.sparse_systems import NotConverged, convergence_as_event, warn_not_converged
from karf_engine.segmentation import label_propagation

# most lie at 0 along one axis, where SciPy splits them at the least denormal number
FLAT = "import numpy as np; flat = np.random.default_rng(0).random((2000, 3)); flat[:1500, 2] = 0"
N = 200


# -------------------------------------------------------------------------------------------------------------- neighbors
def test_points_on_a_plane_through_0_have_a_tree():
    """In a process of its own: where this fails it crashes."""
    code = (
        f"import torch; torch.set_flush_denormal(True); {FLAT}; from karf_engine.compute.neighbors import build_kd_tree"
    )
    command = [sys.executable, "-c", f"{code}; print(build_kd_tree(flat).query(flat[0] + 1e-9)[1])"]
    child = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (child.returncode, child.stdout.strip()) == (0, "0"), child.stderr[-500:]


@pytest.mark.parametrize("is_flushing", [True, False])
def test_numbers_are_flushed_after_a_tree_as_before(is_flushing):
    torch.set_flush_denormal(is_flushing)
    try:
        build_kd_tree(np.eye(3))
        with pytest.raises(ValueError, match="finite"):
            build_kd_tree(np.full((3, 2), np.nan))
        assert (math.ulp(0.0) * 1.0 == 0.0) == is_flushing
    finally:
        torch.set_flush_denormal(False)


# ---------------------------------------------------------------------------------------------------------------- solvers
def chain() -> sparse.csr_array:
    """A positive definite chain of N unknowns: what one end says takes as many iterations to reach the other."""
    return sparse.csr_array(sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(N, N)))


def solve_photo(iterations):
    right = np.eye(N)[0]
    found = sparse_systems.solve(chain(), right, np.zeros(N), iterations=iterations)
    return np.linalg.norm(chain() @ found - right)


def solve_points(iterations, monkeypatch):
    monkeypatch.setattr(label_propagation, "MAX_STEPS", iterations)
    system, right = chain(), np.eye(N)[:, :1]
    label_propagation.conjugate_gradients(lambda x: system @ x, np.full(N, 2.0), right, np.zeros((N, 1)))


def test_an_unsolved_system_warns_with_residual_and_iterations(monkeypatch):
    with pytest.warns(NotConverged, match=r"after 5 iterations a relative residual of [0-9.]+e"):
        solve_photo(5)
    with pytest.warns(NotConverged, match="after 5 iterations"):
        solve_points(5, monkeypatch)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert solve_photo(2 * N) <= sparse_systems.TOLERANCE
        solve_points(2 * N, monkeypatch)


def test_a_stage_emits_the_worst_residual_and_keeps_other_warnings():
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
