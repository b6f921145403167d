"""Examples in docstrings run."""

import doctest
import importlib
from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine

PACKAGE = Path(karf_engine.__file__).parent
WITH_EXAMPLES = [path for path in sorted(PACKAGE.rglob("*.py")) if ">>> " in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", WITH_EXAMPLES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_examples_give_what_they_print(path):
    name = ".".join(["karf_engine", *path.relative_to(PACKAGE).with_suffix("").parts])
    results = doctest.testmod(importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert results.attempted and not results.failed
