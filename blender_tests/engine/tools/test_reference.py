"""The reference of commands and of the library is what the code says."""

import ast
import inspect
import subprocess
import sys

import pytest

pytest.importorskip("numpy")

from tools import reference


def test_the_pages_and_the_stub_are_what_the_code_says():
    # in a process of its own: here other tests may have registered kinds of fields, heads and layers
    done = subprocess.run([sys.executable, "-m", "tools.reference", "--check"], cwd=reference.DOCS.parent)
    assert done.returncode == 0, "run python -m tools.reference"


def test_every_command_and_option_is_on_it():
    text = reference.command_line()
    for kind in reference.COMMANDS.values():
        section = text.split(f"## {kind.command}\n")[1].split("\n## ")[0]
        names = set(kind.__dataclass_fields__) - set(reference.Options.__dataclass_fields__)
        assert all(f"`{name}`" in section for name in names), kind


def test_the_stub_types_every_keyword_of_every_function():
    stubs = {node.name: node.args for node in ast.parse(reference.stub()).body if isinstance(node, ast.FunctionDef)}
    assert set(stubs) == set(reference.karf_engine._DEFINES["api"])
    for name, arguments in stubs.items():
        given = [*arguments.args, *arguments.kwonlyargs]
        assert [each.arg for each in given] == list(inspect.signature(getattr(reference.api, name)).parameters), name
        assert all(each.annotation for each in given) and arguments.kwarg is None, name


def test_every_public_name_is_on_the_page_of_the_library_with_an_example():
    sections = reference.library().split("\n### ")[1:]
    names = {section.partition("\n")[0]: section for section in sections}
    assert set(names) == set(reference.karf_engine.__all__) - {"__version__"}
    assert [name for name, text in names.items() if "Example" not in text] == ["PRESETS"]
