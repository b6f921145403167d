"""The engine as an installed library: what is in the wheel, and what it says of itself."""

import configparser
import email
import zipfile
from importlib import import_module

import pytest

from blender_tests.engine.conftest import ROOT
from karf_engine import __version__


@pytest.fixture(scope="module")
def names(wheel):
    return set(zipfile.ZipFile(wheel).namelist())


def read(wheel, name):
    """A file of the wheel's `.dist-info`."""
    return zipfile.ZipFile(wheel).read(f"karf-{__version__}.dist-info/{name}").decode()


def test_every_module_of_the_engine_is_in_it(names):
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "karf_engine").rglob("*.py")}
    assert {name for name in names if name.endswith(".py")} == modules


def test_nothing_else_is_in_it(names):
    assert {name.partition("/")[0] for name in names} == {"karf_engine", f"karf-{__version__}.dist-info"}
    assert {"karf_engine/py.typed", "karf_engine/api.pyi"} <= names
    assert f"karf-{__version__}.dist-info/licenses/LICENSE" in names


def test_the_command_karf_is_the_command_line(wheel):
    entries = configparser.ConfigParser()
    entries.read_string(read(wheel, "entry_points.txt"))
    module, _, function = entries["console_scripts"]["karf"].partition(":")
    assert callable(getattr(import_module(module), function))


def test_it_says_what_it_is(wheel):
    metadata = email.message_from_string(read(wheel, "METADATA"))
    assert (metadata["Name"], metadata["Version"]) == ("karf", __version__)
    assert metadata["License-Expression"] == "GPL-3.0-or-later"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert metadata.get_payload().lstrip().startswith("# KaRF")
    assert set(metadata.get_all("Provides-Extra")) >= {"photos", "metrics", "test", "lint", "docs"}
