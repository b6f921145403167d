"""The engine's rooms from the ground up: each may import those on lower floors, and no others."""

from blender_tests.engine.conftest import ROOT
from blender_tests.layering import violations

FLOORS = (
    ("version", "errors"),
    ("inputs", "names", "failures", "color", "findings", "path_map", "requirements"),
    ("files", "npz", "settings"),
    ("wire", "capture", "progress", "team", "cores", "kernels"),
    ("runtime",),
    ("images", "edit", "checkpoints", "kan", "mixtures"),
    ("plates", "photos", "matting", "palette", "project", "handover", "contact_sheet", "frame_formats"),
    ("locking", "training", "rendering", "poses", "metrics", "farm", "remote", "marking"),
    ("fields",),
    ("heads",),
    ("segmentation", "frames"),
    ("finishing", "looks"),
    ("model",),
    ("scene_points",),
    ("stages",),
    ("library", "warm"),
    ("doctor",),
    ("cli",),
    ("__init__", "__main__"),
)


def test_imports_run_down_and_never_in_a_circle():
    assert violations(ROOT / "karf_engine", FLOORS) == []
