"""The engine and the tools import only from lower floors, without circles; tools stay short."""

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
    ("__init__", "cells", "dev", "convert_bmild", "lock_engine", "opens", "devices", "reference", "translations"),
    ("window",),
    ("evaluate",),
    ("release", "scenes"),
    ("demo",),
)


@pytest.mark.parametrize(("package", "floors"), [("karf_engine", FLOORS), ("tools", TOOLS)])
def test_imports_only_run_downward(package, floors):
    assert violations(ROOT / package, floors) == []


@pytest.mark.parametrize("path", modules(ROOT / "tools").values(), ids=lambda path: path.stem)
def test_tool_is_short_and_imports_only_options_of_stages(path):
    text = path.read_text(encoding="utf-8")
    nodes = list(ast.walk(ast.parse(text)))
    imported = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    stages = {name for name in imported if name.startswith("karf_engine.commands")}
    assert stages <= {"karf_engine.commands.options"} and text.count("\n") <= 300
