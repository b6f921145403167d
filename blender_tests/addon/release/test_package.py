"""The package equals that of Blender's own tool, installs, and upgrades an earlier version."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tools.release.manifest import engine_version

from ..conftest import FAKE_ENGINE, ROOT, make_capture

EXTENSION = ("__init__.py", "blender_manifest.toml", "LICENSE", "CITATION.cff", "karf_engine", "karf_blender", "tools")
OLDER = "0.0.9"


def run(*command, **options):
    done = subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(checkout, out):
    """Build a checkout into a folder and return it."""
    run("-m", "tools.release", "--out", out, cwd=checkout)
    return out


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of a build of this checkout."""
    return build(ROOT, tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def package(built):
    return next(built.glob("karf-*.zip"))


@pytest.fixture(scope="module")
def blenders_tool(bpy):
    """Blender's command line tool for extensions, as a function."""
    tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    return lambda *arguments: run("-I", tool, *arguments)


def contents(package):
    archive = zipfile.ZipFile(package)
    return {name: archive.read(name) for name in archive.namelist()}


def test_package_is_valid_and_equals_that_of_blenders_tool(blenders_tool, package, tmp_path):
    for target in (ROOT, package):
        blenders_tool("validate", target)
    blenders_tool("build", "--source-dir", ROOT, "--output-dir", tmp_path)
    assert contents(package) == contents(tmp_path / package.name)


def test_exclude_patterns_work_as_in_blenders_tool(blenders_tool, tmp_path):
    from tools.release.packing import packed_files

    names = "__init__.py out/a.py in/out/a.py in/b.pyc .c in/.d/e f.zip in/f.zip out2/a in/kept/b in/g.md in/kept/g.md"
    source = tmp_path / "source"
    for name in names.split():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text(name)
    patterns = ["/out/", "*.pyc", ".*", "/*.zip", "out?/", "/in/*.md", "/in/out/"]
    manifest = (ROOT / "blender_manifest.toml").read_text().partition("[build]")[0]
    manifest += f"[build]\npaths_exclude_pattern = {json.dumps(patterns)}\n"
    (source / "blender_manifest.toml").write_text(manifest)
    blenders_tool("build", "--source-dir", source, "--output-filepath", tmp_path / "packed.zip")
    ours = packed_files(source, patterns)
    assert ours == sorted(contents(tmp_path / "packed.zip"))
    assert ours == ["__init__.py", "blender_manifest.toml", "in/f.zip", "in/kept/b", "in/kept/g.md"]


def test_package_holds_only_the_extension(package):
    names = set(contents(package))
    files = {name for name in names if "/" not in name}
    assert files - {"README.md"} == {"__init__.py", "blender_manifest.toml", "LICENSE"}
    assert {name.partition("/")[0] for name in names - files} == {"docs", "karf_engine", "karf_blender"}
    pages = {f"docs/tasks/{page.name}" for page in (ROOT / "docs" / "tasks").iterdir()}
    assert {name for name in names if name.startswith("docs/")} == pages
    data = [name for name in names if name.endswith((".pyc", ".png", ".blend", ".npz"))]
    assert data == ["karf_blender/workspace/workspace.blend"]


def test_repository_index_equals_that_of_blenders_tool(blenders_tool, built, tmp_path):
    ours, theirs = built / "repository" / "index.json", tmp_path / "theirs" / "index.json"
    shutil.copytree(ours.parent, theirs.parent)
    theirs.unlink()
    blenders_tool("server-generate", "--repo-dir", theirs.parent)
    assert json.loads(ours.read_text()) == json.loads(theirs.read_text())


START = """
import json, os, sys
from importlib import import_module
from pathlib import Path
import bpy

def install(package):
    assert bpy.ops.extensions.package_install_files(
        filepath=str(package), repo="user_default", enable_on_install=True) == {"FINISHED"}

def karf(module):
    return import_module(f"bl_ext.user_default.karf.{module}")
"""
END = "\nsys.stdout.flush()\nos._exit(0)\n"  # Blender as a module may crash at the interpreter's exit
INSTALL_FROM_REPOSITORY = """
bpy.context.preferences.system.use_online_access = True  # Blender asks for it even for a file address
repository = bpy.context.preferences.extensions.repos.new(name="KaRF", module="karf", remote_url=sys.argv[1])
bpy.ops.extensions.repo_sync(repo_directory=repository.directory)
bpy.ops.extensions.package_install(repo_directory=repository.directory, pkg_id="karf", enable_on_install=True)
print(json.dumps([addon.module for addon in bpy.context.preferences.addons if "karf" in addon.module]))
"""
WORK_AND_UPGRADE = """
older, newer, capture, folder, fake_engine = map(Path, sys.argv[1:])
install(older)
preferences = bpy.context.preferences.addons["bl_ext.user_default.karf"].preferences
preferences.engine_python, preferences.threads = sys.executable, 3
own = Path(bpy.utils.extension_path_user("bl_ext.user_default.karf", path="engine", create=True))
(own / "note.txt").write_text("kept")
karf("karf_blender.engine_api").ENGINE_FOLDER = fake_engine
steps = karf("karf_blender.steps")
scene = bpy.context.scene
steps.import_capture(scene, capture, folder / "project")
steps.learn_scene(scene).wait()
steps.extract_palette(scene).wait()
name = scene.karf.objects[0].name
steps.set_swatch(scene, name, 1, (0.25, 0.5, 1.25))
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "film.blend"))
bpy.ops.wm.save_userpref()
before = karf("karf_engine.version").__version__
install(newer)
swatch = bpy.context.scene.karf.objects[name].swatches[1]
print(json.dumps([before, karf("karf_engine.version").__version__, list(swatch.color)]))
"""
OPEN_WITH_NEWER = """
folder = Path(sys.argv[1])
bpy.ops.wm.read_userpref()  # Blender as a module does not by itself
bpy.ops.wm.open_mainfile(filepath=str(folder / "film.blend"))
addon = bpy.context.preferences.addons["bl_ext.user_default.karf"]
own = Path(bpy.utils.extension_path_user("bl_ext.user_default.karf", path="engine"))
scene = bpy.context.scene.karf
karf("karf_blender.steps").save_edit(bpy.context.scene, folder / "edit.json")
print(json.dumps({
    "version": karf("karf_engine.version").__version__,
    "engine_python": addon.preferences.engine_python == sys.executable,
    "threads": addon.preferences.threads,
    "note": (own / "note.txt").read_text(),
    "views": len(scene.views),
    "learned": sorted(karf("karf_blender.project.disk").read(bpy.context.scene).stages),
    "color": list(scene.objects[0].swatches[1].color),
}))
"""


def in_blender(user, script, *arguments):
    """Run a script in its own Blender with this user folder; returns its last line of output, as JSON."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(user)}
    output = run("-c", START + script + END, *arguments, env=environment, timeout=300)
    return json.loads(output.strip().splitlines()[-1])


def build_older(folder):
    """Build this checkout as an older version; returns the package."""
    (folder / "checkout").mkdir(parents=True)
    for name in EXTENSION:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / "checkout" / name)
    for name in ("blender_manifest.toml", "CITATION.cff", "karf_engine/version.py"):
        path = folder / "checkout" / name
        path.write_text(path.read_text().replace(engine_version(ROOT), OLDER, 1))
    return build(folder / "checkout", folder / "dist") / f"karf-{OLDER}.zip"


def read_files(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_blender_installs_from_the_repository(built, tmp_path):
    address = (built / "repository" / "index.json").as_uri()
    assert in_blender(tmp_path, INSTALL_FROM_REPOSITORY, address) == ["bl_ext.karf.karf"]


def test_upgrade_keeps_preferences_projects_and_edits(bpy, addon, package, tmp_path):
    if bpy.app.version < (4, 3):
        pytest.skip("Blender 4.2 as a module crashes where it reads its own preferences")
    capture, user = make_capture(addon, tmp_path / "pots", 3, 24, 16), tmp_path / "user"
    older = build_older(tmp_path / "older")
    result = in_blender(user, WORK_AND_UPGRADE, older, package, capture, tmp_path, FAKE_ENGINE)
    assert result == [OLDER, engine_version(ROOT), [0.25, 0.5, 1.25]]
    learned = read_files(tmp_path / "project")
    assert in_blender(user, OPEN_WITH_NEWER, tmp_path) == {
        "version": engine_version(ROOT),
        "engine_python": True,
        "threads": 3,
        "note": "kept",
        "views": 3,
        "learned": ["geometry", "palette", "recoloring"],
        "color": [0.25, 0.5, 1.25],
    }
    assert read_files(tmp_path / "project") == learned
    assert "1.25" in (tmp_path / "edit.json").read_text()
