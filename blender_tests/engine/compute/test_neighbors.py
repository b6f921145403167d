"""Nearest neighbors are found where denormal numbers are flushed to zero, as all of the engine's work is done."""

import math
import subprocess
import sys

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from karf_engine.compute.neighbors import build_kd_tree

# most lie at 0 along one axis, where SciPy splits them at the least denormal number
FLAT = "import numpy as np; flat = np.random.default_rng(0).random((2000, 3)); flat[:1500, 2] = 0"


@pytest.fixture
def flushed():
    torch.set_flush_denormal(True)
    yield
    torch.set_flush_denormal(False)


def is_flushing() -> bool:
    return math.ulp(0.0) * 1.0 == 0.0


def test_points_on_a_plane_through_0_have_a_tree():
    """In a process of its own: where this fails it crashes."""
    code = f"import torch; torch.set_flush_denormal(True); {FLAT}"
    code += (
        "; from karf_engine.compute.neighbors import build_kd_tree; print(build_kd_tree(flat).query(flat[0] + 1e-9)[1])"
    )
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert (child.returncode, child.stdout.strip()) == (0, "0"), child.stderr[-500:]


def test_numbers_are_flushed_after_it_as_before(flushed):
    build_kd_tree(np.eye(3))
    assert is_flushing()
    torch.set_flush_denormal(False)
    build_kd_tree(np.eye(3))
    assert not is_flushing()


def test_a_tree_that_is_refused_changes_nothing_either(flushed):
    with pytest.raises(ValueError, match="finite"):
        build_kd_tree(np.full((3, 2), np.nan))
    assert is_flushing()
