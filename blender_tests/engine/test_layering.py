"""The engine's rooms from the ground up: each may import those on lower floors, and no others."""

from blender_tests.engine.conftest import ROOT
from blender_tests.layering import violations

FLOORS = (
    ("version", "errors"),
    ("io", "compute"),
    ("capture",),
    ("project",),
    ("palettes", "kan", "metrics"),
    ("fields",),
    ("heads", "splats"),
    ("segmentation",),
    ("recolor",),
    ("export",),
    ("commands",),
    ("worker",),
    ("api", "remote"),
    ("cli",),
    ("__init__", "__main__"),
)


def test_imports_run_down_and_never_in_a_circle():
    assert violations(ROOT / "karf_engine", FLOORS) == []
