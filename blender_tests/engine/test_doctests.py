"""Examples in docstrings run, and every public function of a documented room has one."""

import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine

# rooms of which every public function must have an example, and their modules that work on a project's files
ROOMS = ("fields/rendering", "kan", "palettes", "export")
ON_PROJECTS = re.compile(
    r"palettes\.(colorways\.planned|project_edit)|export\.(colorway_|contact_|finished_|frame_|point_sampling)"
)
FLAGS = doctest.NORMALIZE_WHITESPACE


def modules(rooms):
    """Names of the modules of these rooms."""
    folder = Path(karf_engine.__file__).parent
    assert all((folder / room).is_dir() for room in rooms)
    files = [path for room in rooms for path in sorted((folder / room).rglob("*.py")) if path.stem[:2] != "__"]
    return [".".join(["karf_engine", *path.relative_to(folder).with_suffix("").parts]) for path in files]


def public_functions(name):
    """The functions that a module defines, by name."""
    module = importlib.import_module(name)
    functions = inspect.getmembers(module, inspect.isfunction)
    return {n: f for n, f in functions if f.__module__ == name and not n.startswith("_")}


def documented():
    return [name for name in modules(ROOMS) if not ON_PROJECTS.match(name.removeprefix("karf_engine."))]


FUNCTIONS = {f"{name}.{function}": f for name in documented() for function, f in public_functions(name).items()}


@pytest.mark.parametrize("name", modules([""]))
def test_examples_give_what_they_print(name):
    results = doctest.testmod(importlib.import_module(name), optionflags=FLAGS)
    assert results.failed == 0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_has_an_example(name):
    function = inspect.unwrap(FUNCTIONS[name])
    assert doctest.DocTestParser().get_examples(inspect.getdoc(function) or ""), f"{name} has no example"
