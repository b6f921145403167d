"""The layers and the gated block without the rest of the engine."""

import doctest
import subprocess
import sys

import pytest

torch = pytest.importorskip("torch")

from blender_tests.engine.conftest import ROOT
from karf_engine import kan

GROUND = {f"karf_engine.{room}" for room in ("compute", "errors", "io", "project", "version")}  # none knows a scene


def test_layers_and_block_load_no_other_room():
    code = "import sys; from karf_engine.kan import GRBFLayer, GatedBlock; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    loaded = {name for name in done.stdout.split() if name.startswith("karf_engine.")}
    rooms = {".".join(name.split(".")[:2]) for name in loaded}
    assert "karf_engine.kan" in rooms and rooms - {"karf_engine.kan"} <= GROUND


def test_the_usage_example_of_the_package_runs():
    results = doctest.testmod(kan)
    assert results.attempted > 5 and results.failed == 0


def test_everything_that_the_package_offers_is_there():
    assert all(hasattr(kan, name) for name in kan.__all__)
