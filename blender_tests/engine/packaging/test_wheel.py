"""The engine's wheel: its files, metadata and command."""

import configparser
import email
import zipfile
from importlib import import_module

from blender_tests.engine.conftest import ROOT
from karf_engine import __version__


def read(wheel, name):
    """A file of the wheel's `.dist-info`."""
    return zipfile.ZipFile(wheel).read(f"karf-{__version__}.dist-info/{name}").decode()


def test_wheel_has_exactly_the_engine(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "karf_engine").rglob("*.py")}
    assert {name for name in names if name.endswith(".py")} == modules
    assert {name.partition("/")[0] for name in names} == {"karf_engine", f"karf-{__version__}.dist-info"}
    assert {"karf_engine/py.typed", "karf_engine/api.pyi", "karf_engine/export/page/web/dist/page.js"} <= names
    assert f"karf-{__version__}.dist-info/licenses/LICENSE" in names


def test_command_karf_is_the_command_line(wheel):
    entries = configparser.ConfigParser()
    entries.read_string(read(wheel, "entry_points.txt"))
    module, _, function = entries["console_scripts"]["karf"].partition(":")
    assert callable(getattr(import_module(module), function))


def test_metadata_describes_the_project(wheel):
    metadata = email.message_from_string(read(wheel, "METADATA"))
    assert (metadata["Name"], metadata["Version"]) == ("karf", __version__)
    assert metadata["License-Expression"] == "GPL-3.0-or-later"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert metadata.get_payload().lstrip().startswith("# KaRF")
    assert set(metadata.get_all("Provides-Extra")) >= {"photos", "metrics", "test", "lint", "docs"}
