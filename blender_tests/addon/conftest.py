"""Enables the checkout as the extension bl_ext.karf_test.karf and starts every test in an empty file."""

import importlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULE = "bl_ext.karf_test.karf"
ENGINE_PYTHON = os.environ.get("KARF_ENGINE_PYTHON")  # the tests replace it with that of the fake engine
FAKE_ENGINE = Path(__file__).parent / "fake_engine"
# package of karf_blender -> its modules that tests use; the fixture `addon` has them as attributes
MODULES = {
    "": "compositor engine_api nodes preferences progress session steps",
    "host": "compat rendering windows words",
    "engine": "failures installing probing processes worker",
    "engine.installer": "home",
    "preferences": "color_book state",
    "project": "captures disk folders image_paths moving",
    "pictures": "editors images photos sequences tints",
    "rig": "cameras lens reprojection",
    "swatches": "colors outputs overlays edits looks object_masks gestures palettes displayed solving views",
    "marking": "history objects overlay mask_layers photo proposals raster tools",
    "render_engine": "camera_pixels still viewport",
    "steps": "masks preview splats",
    "tasks": "queries runner",
    "surface": "scene_object splat_objects",
    "operators": "colorways project render",
    "panels": "editing display learning sidebar swatching",
    "workspace": "estimates following opening states statusbar",
}
_exit_code = None
_has_blender = False


@pytest.fixture(scope="session")
def bpy(tmp_path_factory):
    """Blender as a module, with the checkout enabled as an extension."""
    global _has_blender
    bpy = pytest.importorskip("bpy")
    _has_blender = True
    repository = tmp_path_factory.mktemp("repository")
    (repository / "karf").symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(name="KaRF test", module="karf_test", custom_directory=str(repository))
    assert bpy.ops.preferences.addon_enable(module=MODULE) == {"FINISHED"}
    return bpy


@pytest.fixture
def addon(bpy, monkeypatch):
    """The add-on's modules by name, in an empty file, with the fake engine behind them."""
    bpy.ops.wm.read_homefile(use_empty=True)
    modules = SimpleNamespace(extension=importlib.import_module(f"{MODULE}.karf_blender"))
    for folder, names in MODULES.items():
        package = f"{MODULE}.karf_blender.{folder}".rstrip(".")
        for name in names.split():
            setattr(modules, name, importlib.import_module(f"{package}.{name}"))
    modules.render_photos = importlib.import_module(f"{MODULE}.karf_blender.render_engine.photos")
    monkeypatch.setattr(modules.engine_api, "ENGINE_FOLDER", FAKE_ENGINE)
    # swatches are those learned; tests of an object's paints look for them
    monkeypatch.setattr(modules.palettes, "object_paints", lambda seen: ())
    monkeypatch.setenv("KARF_ENGINE_PYTHON", sys.executable)
    yield modules
    assert not modules.runner.is_running()
    modules.preview.stop()
    modules.queries.stop()
    modules.session.get(modules.still.RenderWorker).close()
    modules.runner.release()


@pytest.fixture
def preferences(addon):
    """The extension's preferences, with engine and threads reset after the test."""
    addon.probing.cancel()
    yield addon.preferences.current()
    preferences = addon.preferences.current()  # a test may have loaded others
    preferences.engine_python, preferences.engine_folder, preferences.threads = "", "", 0
    addon.probing.cancel()


@pytest.fixture
def scene(bpy, addon):
    return bpy.context.scene


@pytest.fixture
def seeing(bpy, addon):
    """The display settings of pictures, at their defaults before and after the test."""

    def reset():
        for name in seeing.bl_rna.properties.keys():
            seeing.property_unset(name)

    seeing = bpy.context.window_manager.karf_seeing
    reset()
    yield seeing
    reset()


@pytest.fixture
def image_editor(bpy, addon):
    """The first area of the window, as an Image Editor."""
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    area.type = "IMAGE_EDITOR"
    return area


@pytest.fixture
def reopen(bpy, tmp_path):
    """A function that saves the file, reopens it, and returns its scene."""

    def reopen(name="shot.blend"):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / name))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / name))
        return bpy.context.scene

    return reopen


@pytest.fixture
def capture_folder(addon, tmp_path):
    """An instant-ngp style capture of three 24 x 16 photos."""
    return make_capture(addon, tmp_path / "pots", 3, 24, 16)


def make_capture(addon, folder, count, width, height):
    """Write photos of different gradients and their transforms.json; returns the folder."""
    api, views = addon.engine_api, []
    for number in range(count):
        angle = 0.4 * number
        pose = np.eye(4)
        pose[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        pose[:3, 3] = pose[:3, 2] * 3
        camera = api.Camera(width, height, 30.0, 28.0, width / 2 + 1, height / 2 - 2, pose)
        name = f"photo_{number}"
        rows, columns = np.mgrid[0:height, 0:width]
        photo = np.stack([rows / height, columns / width, np.full((height, width), number / count)], -1)
        addon.images.write_png(folder / "images" / f"{name}.png", photo)
        views.append(api.View(f"images/{name}.png", name, camera, None, "train"))
    api.write_cameras(folder / "transforms.json", views)
    return folder


@pytest.fixture
def project_scene(addon, scene, capture_folder, tmp_path):
    """The scene with the capture imported, and nothing learned yet."""
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    return scene


@pytest.fixture
def two_splits(addon, tmp_path):
    """A NeRF-synthetic capture whose training and test photo are both called r_000."""
    folder = make_capture(addon, tmp_path / "splits", 2, 24, 16)
    content = json.loads((folder / "transforms.json").read_text())
    for number, (split, frame) in enumerate(zip(("train", "test"), content["frames"], strict=True)):
        (folder / split).mkdir()
        (folder / "images" / f"photo_{number}.png").rename(folder / split / "r_000.png")
        frame["file_path"] = f"./{split}/r_000"
        (folder / f"transforms_{split}.json").write_text(json.dumps(content | {"frames": [frame]}))
    (folder / "transforms.json").unlink()
    return folder


@pytest.fixture(scope="session")
def layers_file(tmp_path_factory):
    """A 40 x 30 layered EXR of the fake engine's objects, written by the real engine."""
    python = ENGINE_PYTHON or ROOT / ".venv" / "engine" / "bin" / "python"
    folder = tmp_path_factory.mktemp("layers")
    script = Path(__file__).parent / "compositor" / "make_layers.py"
    made = subprocess.run([python, script, folder], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return folder / "layers" / "photo_0.exr"


def run_without_extension(code, blend, out):
    """Open a file in a Blender without the extension, and run code that writes to `out`."""
    start = "import os, sys, bpy, numpy as np\nblend, out = sys.argv[-2:]\nbpy.ops.wm.open_mainfile(filepath=blend)\n"
    code = f'{start}assert not hasattr(bpy.types.Scene, "karf")\n{code}\nos._exit(0)'
    subprocess.run([sys.executable, "-c", code, blend, out], check=True, capture_output=True, timeout=120)


@pytest.fixture
def learned(bpy, addon, capture_folder, tmp_path_factory, tmp_path):
    """The scene with palettes and its first view shown; the engine runs once for all tests."""
    karf, project, kept = addon.steps, tmp_path / "project", tmp_path_factory.getbasetemp() / "learned_project"
    if kept.exists():
        shutil.copytree(kept, project)
    karf.import_capture(bpy.context.scene, capture_folder, project)
    if not kept.exists():
        karf.learn_scene(bpy.context.scene).wait()
        karf.extract_palette(bpy.context.scene).wait()
        shutil.copytree(project, kept)
    else:
        palettes = addon.engine_api.read_palettes(addon.folders.project_of(bpy.context.scene).palette_file)
        addon.palettes.load_palettes(bpy.context.scene, palettes)
        karf.show_view(bpy.context.scene).wait()
    return bpy.context.scene


def pytest_sessionfinish(session, exitstatus):
    global _exit_code
    _exit_code = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    # bpy 4.2 and 4.5 crash or hang when the interpreter exits with Blender objects alive
    if _has_blender and _exit_code is not None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_exit_code)
