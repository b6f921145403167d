"""The tools' rooms from the ground up: each may import those on lower floors, and no others."""

import ast

from blender_tests.engine.conftest import ROOT
from blender_tests.layering import modules, violations

FLOORS = (
    ("metrics",),
    (
        "__init__",
        "cells",
        "dev",
        "convert_bmild",
        "lock_engine",
        "reference",
        "translations",
    ),
    ("window",),
    ("evaluate",),
    ("release", "scenes"),
    ("demo",),
)
PRIVATE = "karf_engine.commands"  # what the stages do is offered by the engine's public functions
DECLARED = "karf_engine.commands.options"  # what the stages are asked, of which `reference` writes a page


def test_imports_run_down_and_never_in_a_circle():
    assert violations(ROOT / "tools", FLOORS) == []


def test_no_tool_reaches_into_the_stages():
    reaching = [name for name, path in modules(ROOT / "tools").items() if any(map(_is_private, ast.walk(_tree(path))))]
    assert reaching == []


def _tree(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def _is_private(node):
    named = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
    named += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
    return any(name.startswith(PRIVATE) and name != DECLARED for name in named)


def test_no_tool_is_long():
    lengths = {
        name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in modules(ROOT / "tools").items()
    }
    assert {name: length for name, length in lengths.items() if length > 300} == {}
