"""Rooms of the engine and of the tools from the ground up: each may import those on lower floors, and no others."""

import ast

import pytest

from blender_tests.engine.conftest import ROOT
from blender_tests.layering import modules, violations

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
TOOLS = (
    ("metrics",),
    ("__init__", "cells", "dev", "convert_bmild", "lock_engine", "reference", "translations"),
    ("window",),
    ("evaluate",),
    ("release", "scenes"),
    ("demo",),
)


@pytest.mark.parametrize(("package", "floors"), [("karf_engine", FLOORS), ("tools", TOOLS)])
def test_imports_run_down_and_never_in_a_circle(package, floors):
    assert violations(ROOT / package, floors) == []


@pytest.mark.parametrize("path", modules(ROOT / "tools").values(), ids=lambda path: path.stem)
def test_a_tool_is_short_and_imports_no_stage_but_what_it_declares(path):
    text = path.read_text(encoding="utf-8")
    nodes = list(ast.walk(ast.parse(text)))
    named = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    named |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    private = {name for name in named if name.startswith("karf_engine.commands")}
    assert private <= {"karf_engine.commands.options"} and text.count("\n") <= 300
