"""The notebooks run from their first cell to their last, in a small setting, and leave the pictures they speak of."""

import os
import subprocess
import sys

import imageio.v3 as iio
import pytest

from blender_tests.engine.conftest import ROOT

pytest.importorskip("torch")

PICTURES = {
    "recolor_a_capture": ["learned.png", "recolored.png", "new_camera.png"],
    "what_a_kan_head_learns": ["slices.png", "edges.png"],
}


def test_every_notebook_is_run():
    assert {path.stem for path in (ROOT / "notebooks").glob("*.py")} == set(PICTURES)


@pytest.mark.parametrize("name", PICTURES)
def test_a_notebook_runs_and_shows_pictures(name, tmp_path):
    small = {"KARF_NOTEBOOK": "small", "KARF_NOTEBOOK_OUT": str(tmp_path), "OMP_NUM_THREADS": "1"}
    variables = os.environ | small | {"PYTHONPATH": str(ROOT)}
    script = ROOT / "notebooks" / f"{name}.py"
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env=variables, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    for picture in PICTURES[name]:
        assert iio.imread(tmp_path / picture).std() > 5, f"{picture} is one color"
