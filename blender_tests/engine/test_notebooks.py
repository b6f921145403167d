"""The notebooks run from start to end with small settings and write their pictures."""

import os
import subprocess
import sys

import imageio.v3 as iio
import pytest

from blender_tests.engine.conftest import ROOT

PICTURES = {
    "recolor_a_capture": ["learned.png", "recolored.png", "new_camera.png"],
    "what_a_kan_head_learns": ["slices.png", "edges.png"],
}


@pytest.mark.parametrize("script", sorted((ROOT / "notebooks").glob("*.py")), ids=lambda path: path.stem)
def test_notebook_runs_and_writes_pictures(script, tmp_path):
    small = {"KARF_NOTEBOOK": "small", "KARF_NOTEBOOK_OUT": str(tmp_path), "OMP_NUM_THREADS": "1"}
    options = {"cwd": tmp_path, "env": os.environ | small | {"PYTHONPATH": str(ROOT)}, "timeout": 300}
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stderr
    for picture in PICTURES[script.stem]:
        assert iio.imread(tmp_path / picture).std() > 5, f"{picture} is one color"
