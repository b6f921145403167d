"""What the window stories ask the extension for is there: they run in no test."""

import ast
import importlib
from pathlib import Path

import pytest

from .conftest import MODULE

FOLDER = Path(__file__).resolve().parents[2] / "tools" / "window"


def asked_for(tree):
    """(module, attribute) of every `desk.module("tasks.runner").is_running`, also by way of a local name."""
    for function in (each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef)):
        names = {}
        for node in ast.walk(function):
            if isinstance(node, ast.Assign):
                targets, values = node.targets[0], node.value
                pairs = (
                    zip(targets.elts, values.elts, strict=True) if _are_tuples(targets, values) else [(targets, values)]
                )
                names |= {
                    target.id: name for target, value in pairs if (name := _module_in(value)) and _is_name(target)
                }
        for node in ast.walk(function):
            if isinstance(node, ast.Attribute):
                name = _module_in(node.value) or (_is_name(node.value) and names.get(node.value.id))
                if name:
                    yield name, node.attr


def _is_name(node):
    return isinstance(node, ast.Name)


def _are_tuples(targets, values):
    return isinstance(targets, ast.Tuple) and isinstance(values, ast.Tuple)


def _module_in(node):
    """The name in `desk.module("name")`."""
    is_call = isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) == "module"
    return node.args[0].value if is_call and isinstance(node.args[0], ast.Constant) else None


@pytest.mark.parametrize("file", sorted(path.name for path in FOLDER.glob("*.py")))
def test_modules_have_what_the_stories_use(addon, file):
    asked = set(asked_for(ast.parse((FOLDER / file).read_text())))
    modules = {name: importlib.import_module(f"{MODULE}.karf_blender.{name}") for name, _ in asked}
    assert {(name, attribute) for name, attribute in asked if not hasattr(modules[name], attribute)} == set()


def test_names_are_found():
    source = 'def f():\n    a, b = 1, desk.module("x")\n    b.c()\n    desk.module("y.z").d'
    assert set(asked_for(ast.parse(source))) == {("x", "c"), ("y.z", "d")}
