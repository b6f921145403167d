"""The extension as a package: Blender's own tool accepts it, and nothing but the extension is in it."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool(bpy):
    """Blender's command line tool for extensions; it needs nothing but the standard library."""
    return Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"


@pytest.fixture(scope="module")
def package(tool, tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-I", str(tool), "build", "--source-dir", str(ROOT), "--output-dir", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("karf-*.zip"))


def test_blenders_tool_accepts_folder_and_package(tool, package):
    for target in (ROOT, package):
        done = subprocess.run(
            [sys.executable, "-I", str(tool), "validate", str(target)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_holds_the_extension_and_nothing_else(package):
    names = zipfile.ZipFile(package).namelist()
    for needed in (
        "__init__.py",
        "blender_manifest.toml",
        "LICENSE",
        "karf_engine/__init__.py",
        "karf_blender/rig/cameras.py",
    ):
        assert needed in names
    tops = {name.partition("/")[0] for name in names}
    assert tops <= {"__init__.py", "blender_manifest.toml", "LICENSE", "README.md", "karf_engine", "karf_blender"}
    assert not [name for name in names if name.endswith((".pyc", ".png", ".blend", ".npz"))]


def test_the_manifest_tells_the_engines_version():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    version = (ROOT / "karf_engine" / "version.py").read_text().partition('__version__ = "')[2].partition('"')[0]
    assert manifest["version"] == version
    assert manifest["blender_version_min"] == "4.2.0"
