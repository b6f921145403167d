"""Captures that one process learns in turn take no more memory than one."""

import os

import pytest

pytest.importorskip("torch")

from blender_tests.engine.conftest import QUICK
from blender_tests.engine.peak import peak_of

# a field of some 300 MB with its moments, in a few seconds
LARGE = (
    'geometry.levels=[{"voxels": 128, "iterations": 2, "step": 1.0}]',
    "geometry.samples=4000",
    "geometry.features=12",
)
LEARN = (
    "import gc; import karf_engine as karf; gc.disable(); import torch, karf_engine.commands.geometry; "
    "[karf.learn_geometry(sys.argv[1], project=Path(sys.argv[2], str(number)), overrides=sys.argv[4:], threads=1) "
    "for number in range(int(sys.argv[3]))]"
)


@pytest.mark.skipif(os.name == "nt", reason="the peak is read from /proc")
def test_four_captures_peak_hardly_above_one_even_without_the_garbage_collector(still_life, tmp_path):
    none, one, four = (
        peak_of(LEARN, still_life.capture, tmp_path / str(count), count, *QUICK, *LARGE) for count in (0, 1, 4)
    )
    assert one > none + 100e6 and four - none <= 1.2 * (one - none), (none, one, four)
