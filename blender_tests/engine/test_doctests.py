"""Examples in docstrings run and print what they show."""

import doctest
import importlib

import pytest

from blender_tests.engine.conftest import ROOT

FILES = [path for path in sorted((ROOT / "karf_engine").rglob("*.py")) if ">>> " in path.read_text(encoding="utf-8")]
MODULES = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in FILES]


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_hold(name):
    results = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert results.attempted and not results.failed
