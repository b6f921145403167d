"""The package in a Blender of its own: installed from a file and from the repository, and over the version before."""

import hashlib

import pytest

from blender_tests.addon.conftest import make_capture
from blender_tests.addon.release.packages import ROOT, build, build_as, in_blender
from tools.release.manifest import engine_version

OLDER = "0.0.9"
FAKE_ENGINE = ROOT / "blender_tests" / "addon" / "fake_engine"
INSTALL = """
def install(package):
    assert bpy.ops.extensions.package_install_files(
        filepath=str(package), repo="user_default", enable_on_install=True) == {"FINISHED"}

def karf(module):
    from importlib import import_module
    return import_module(f"bl_ext.user_default.karf.{module}")
"""
WORK_WITH_THE_OLDER = """
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
OPEN_WITH_THE_NEWER = """
folder = Path(sys.argv[1])
bpy.ops.wm.read_userpref()  # which Blender as a module does not by itself
bpy.ops.wm.open_mainfile(filepath=str(folder / "film.blend"))
addon = bpy.context.preferences.addons["bl_ext.user_default.karf"]
own = Path(bpy.utils.extension_path_user("bl_ext.user_default.karf", path="engine"))
scene = bpy.context.scene.karf
steps = karf("karf_blender.steps")
steps.save_edit(bpy.context.scene, folder / "edit.json")
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
FROM_THE_REPOSITORY = """
bpy.context.preferences.system.use_online_access = True  # Blender asks for it even where the address is a file's
repository = bpy.context.preferences.extensions.repos.new(name="KaRF", module="karf", remote_url=sys.argv[1])
bpy.ops.extensions.repo_sync(repo_directory=repository.directory)
bpy.ops.extensions.package_install(repo_directory=repository.directory, pkg_id="karf", enable_on_install=True)
print(json.dumps([addon.module for addon in bpy.context.preferences.addons if "karf" in addon.module]))
"""


@pytest.fixture(scope="module")
def package(bpy, tmp_path_factory):
    return next(build(ROOT, tmp_path_factory.mktemp("dist")).glob("karf-*.zip"))


def digests(folder):
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_blender_installs_it_from_the_repository(package, tmp_path):
    address = (package.parent / "repository" / "index.json").as_uri()
    assert in_blender(tmp_path, FROM_THE_REPOSITORY, address) == ["bl_ext.karf.karf"]


def test_an_upgrade_keeps_preferences_projects_and_edits(bpy, addon, package, tmp_path):
    if bpy.app.version < (4, 3):
        pytest.skip("Blender 4.2 as a module crashes where it reads its own preferences")
    capture, user = make_capture(addon, tmp_path / "pots", 3, 24, 16), tmp_path / "user"
    older = next(build_as(OLDER, tmp_path / "older").glob(f"karf-{OLDER}.zip"))
    told = in_blender(user, INSTALL + WORK_WITH_THE_OLDER, older, package, capture, tmp_path, FAKE_ENGINE)
    assert told == [OLDER, engine_version(ROOT), [0.25, 0.5, 1.25]]
    learned = digests(tmp_path / "project")
    found = in_blender(user, INSTALL + OPEN_WITH_THE_NEWER, tmp_path)
    assert found == {
        "version": engine_version(ROOT),
        "engine_python": True,
        "threads": 3,
        "note": "kept",
        "views": 3,
        "learned": ["geometry", "palette", "recoloring"],
        "color": [0.25, 0.5, 1.25],
    }
    assert digests(tmp_path / "project") == learned
    assert "1.25" in (tmp_path / "edit.json").read_text()
