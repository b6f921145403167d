"""The stub of the library and the pages that the site adds are what the code says."""

import ast
import inspect
import re
import subprocess
import sys

import pytest

from blender_tests.engine.conftest import ROOT

pytest.importorskip("numpy")

from karf_engine.io.options import flag_of
from tools import reference


def test_the_stub_is_up_to_date_and_types_every_keyword_of_every_function():
    # in a process of its own: here other tests may have registered kinds of fields, heads and layers
    done = subprocess.run([sys.executable, "-m", "tools.reference", "--check"], cwd=ROOT)
    assert done.returncode == 0, "run python -m tools.reference"
    stubs = {node.name: node.args for node in ast.parse(reference.stub()).body if isinstance(node, ast.FunctionDef)}
    assert set(stubs) == set(reference.karf_engine._DEFINES["api"])
    for name, arguments in stubs.items():
        given = [*arguments.args, *arguments.kwonlyargs]
        assert [each.arg for each in given] == list(inspect.signature(getattr(reference.api, name)).parameters), name
        assert all(each.annotation for each in given) and arguments.kwarg is None, name


@pytest.mark.parametrize("kind", reference.COMMANDS.values(), ids=list(reference.COMMANDS))
def test_the_site_has_every_command_with_every_option(kind):
    section = reference.command_line().split(f"## {kind.command}\n")[1].split("\n## ")[0]
    fields = [item for item in reference.fields_in_help_order(kind) if not item.metadata["positional"]]
    assert [flag for flag in map(flag_of, fields) if flag and flag not in section] == []


def test_the_site_has_every_public_name_and_each_has_an_example():
    names = re.findall(r"^### (\w+)$", reference.library(), re.MULTILINE)
    assert sorted(names) == sorted(set(reference.karf_engine.__all__) - {"__version__"})
    documented = {name: inspect.getdoc(getattr(reference.karf_engine, name)) for name in names}
    assert [name for name, text in documented.items() if "Example" not in text] == ["PRESETS"]


def test_the_written_page_lists_every_verb():
    assert re.findall(r"^    ([a-z-]+)(?: |$)", reference._printed("--help"), re.MULTILINE) == [*reference.VERBS]
    rows = re.findall(r"^\| (`.*?`) \|", (ROOT / "docs" / "command_line.md").read_text(), re.MULTILINE)
    assert sorted(re.findall(r"`([\w-]+)`", "".join(rows))) == sorted(reference.VERBS)
