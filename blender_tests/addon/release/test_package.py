"""The extension as a package: what the build packs without Blender is what Blender's own tool would."""

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from blender_tests.addon.release.packages import ROOT, build


@pytest.fixture(scope="module")
def blenders_tool(bpy):
    """Run Blender's command line tool for extensions; it needs nothing but the standard library."""
    tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"

    def run(*arguments):
        done = subprocess.run([sys.executable, "-I", tool, *arguments], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr

    return run


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """What the build writes of this checkout."""
    return build(ROOT, tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def package(built):
    return next(built.glob("karf-*.zip"))


def contents(package):
    archive = zipfile.ZipFile(package)
    return {name: archive.read(name) for name in archive.namelist()}


def test_blenders_tool_accepts_folder_and_package(blenders_tool, package):
    for target in (ROOT, package):
        blenders_tool("validate", target)


def test_the_package_holds_what_blenders_own_tool_packs(blenders_tool, package, tmp_path):
    blenders_tool("build", "--source-dir", ROOT, "--output-dir", tmp_path)
    assert contents(package) == contents(tmp_path / package.name)


def test_the_package_has_the_translations(package):
    name = "karf_blender/translations/zh_HANS.po"
    assert contents(package)[name] == (ROOT / name).read_bytes()


def test_every_kind_of_pattern_means_what_it_means_to_blenders_tool(blenders_tool, tmp_path):
    from tools.release.packing import packed_files

    for name in (
        "__init__.py",
        "out/a.py",
        "in/out/a.py",
        "in/b.pyc",
        ".c",
        "in/.d/e",
        "f.zip",
        "in/f.zip",
        "out2/a",
        "in/kept/b",
        "in/g.md",
        "in/kept/g.md",
    ):
        path = tmp_path / "source" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    patterns = ["/out/", "*.pyc", ".*", "/*.zip", "out?/", "/in/*.md", "/in/out/"]
    manifest = (ROOT / "blender_manifest.toml").read_text().partition("[build]")[0]
    (tmp_path / "source" / "blender_manifest.toml").write_text(
        f"{manifest}[build]\npaths_exclude_pattern = {json.dumps(patterns)}\n"
    )
    blenders_tool("build", "--source-dir", tmp_path / "source", "--output-filepath", tmp_path / "packed.zip")
    ours = packed_files(tmp_path / "source", patterns)
    assert ours == sorted(contents(tmp_path / "packed.zip"))
    assert ours == ["__init__.py", "blender_manifest.toml", "in/f.zip", "in/kept/b", "in/kept/g.md"]


def test_the_package_holds_the_extension_and_nothing_else(package):
    names = set(contents(package))
    assert {"__init__.py", "blender_manifest.toml", "LICENSE", "karf_engine/__init__.py"} <= names
    assert "karf_blender/rig/cameras.py" in names
    tops = {name.partition("/")[0] for name in names}
    assert tops <= {
        "__init__.py",
        "blender_manifest.toml",
        "LICENSE",
        "README.md",
        "docs",
        "karf_engine",
        "karf_blender",
    }
    assert {name for name in names if name.startswith("docs/")} == {
        f"docs/tasks/{page.name}" for page in (ROOT / "docs" / "tasks").iterdir()
    }
    data = [name for name in names if name.endswith((".pyc", ".png", ".blend", ".npz"))]
    assert data == ["karf_blender/workspace/workspace.blend"]


def test_the_repository_lists_what_blenders_own_generator_lists(blenders_tool, built, tmp_path):
    shutil.copytree(built / "repository", tmp_path / "theirs")
    (tmp_path / "theirs" / "index.json").unlink()
    blenders_tool("server-generate", "--repo-dir", tmp_path / "theirs")
    ours, theirs = (
        json.loads((folder / "index.json").read_text()) for folder in (built / "repository", tmp_path / "theirs")
    )
    assert ours == theirs
