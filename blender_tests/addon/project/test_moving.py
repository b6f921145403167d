"""Moving a project beside its file and saving the file elsewhere keep paths and swatches."""

import json
import shutil

import numpy as np
import pytest

from ..saved_files import colors


@pytest.fixture
def hidden(addon, learned, tmp_path, monkeypatch):
    """The learned scene with its project in the extension's own folder."""
    own = tmp_path / "user" / "projects"
    monkeypatch.setattr(addon.moving, "_own_folder", lambda: own)
    shutil.copytree(addon.folders.project_of(learned).folder, own / "pots")
    learned.karf.project = str(own / "pots")
    learned.karf.out = str(own / "pots" / "out")
    return learned


@pytest.fixture
def saved(bpy, hidden, tmp_path):
    (tmp_path / "desk").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "desk" / "shot.blend"))
    return hidden


def folder_of(addon, scene):
    return addon.folders.project_of(scene).folder


def test_project_moves_next_to_its_saved_file(bpy, addon, saved, tmp_path):
    old, files = folder_of(addon, saved), sorted(path.name for path in folder_of(addon, saved).rglob("*.npz"))
    addon.steps.set_swatch(saved, "pot", 1, (0.25, 0.5, 0.75))
    addon.images.write_png(old / "photos" / "straight.png", np.zeros((4, 4, 3)))
    photo = bpy.data.images.load(str(old / "photos" / "straight.png"))
    assert bpy.ops.karf.move_project() == {"FINISHED"}
    new = tmp_path / "desk" / "pots_karf"
    assert folder_of(addon, saved) == new and not old.exists()
    assert bpy.path.abspath(photo.filepath) == str(new / "photos" / "straight.png") and photo.size[0] == 4
    assert sorted(path.name for path in new.rglob("*.npz")) == files
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "desk" / "shot.blend"))
    scene = bpy.context.scene
    assert (scene.karf.project, scene.karf.out) == ("//pots_karf", "//pots_karf/out")
    assert tuple(scene.karf.objects["pot"].swatches[1].color) == (0.25, 0.5, 0.75)
    assert addon.disk.is_prepared(scene)


def test_full_disk_changes_nothing(bpy, addon, saved, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    old = folder_of(addon, saved)
    monkeypatch.setattr(addon.moving.shutil, "copytree", fail)
    with pytest.raises(RuntimeError, match="No space left on device"):
        bpy.ops.karf.move_project()
    assert folder_of(addon, saved) == old and old.is_dir()
    assert sorted(path.name for path in (tmp_path / "desk").iterdir()) == ["shot.blend"]


def test_unsavable_file_still_finds_its_project(bpy, addon, saved, tmp_path):
    """Blender 4.2 moves the folder in its way aside and saves: then the move succeeds."""
    old = folder_of(addon, saved)
    shutil.rmtree(tmp_path / "desk")
    (tmp_path / "desk").mkdir()
    (tmp_path / "desk" / "shot.blend").mkdir()  # in the file's way
    try:
        bpy.ops.karf.move_project()
    except RuntimeError as error:
        assert "could not be saved" in str(error) and old.is_dir()
    else:
        assert (tmp_path / "desk" / "shot.blend").is_file()
        assert not old.exists() and folder_of(addon, saved) == tmp_path / "desk" / "pots_karf"
    assert addon.disk.is_prepared(saved)


def test_undo_after_the_move_keeps_the_new_path(bpy, addon, saved, tmp_path):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.karf.move_project()
    bpy.ops.ed.undo_push(message="Move Project")
    bpy.ops.ed.undo()
    assert folder_of(addon, bpy.context.scene) == tmp_path / "desk" / "pots_karf"


def test_shared_project_is_copied_without_overwriting(bpy, addon, saved, tmp_path):
    (tmp_path / "desk" / "pots_karf").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "desk" / "other.blend"))
    old = folder_of(addon, saved)
    bpy.ops.karf.move_project()
    assert old.is_dir() and folder_of(addon, saved) == tmp_path / "desk" / "pots_karf_2"


def test_hidden_project_is_asked_about_once(bpy, addon, saved):
    asked = addon.session.get(addon.moving.AskedProjects).paths
    assert addon.moving.window_to_ask() is not None
    saved.karf.stays_hidden = True
    assert addon.moving.window_to_ask() is None and bpy.ops.karf.move_project.poll()
    saved.karf.stays_hidden = False
    asked.add(saved.karf.project)
    assert addon.moving.window_to_ask() is None
    asked.clear()
    bpy.ops.karf.move_project()
    assert addon.moving.window_to_ask() is None and not bpy.ops.karf.move_project.poll()


def test_unsaved_file_cannot_move_its_project(bpy, hidden):
    assert not bpy.ops.karf.move_project.poll()


@pytest.fixture
def beside(bpy, addon, learned, tmp_path):
    """The learned scene, edited, saved as root/first/shot.blend with its project beside it."""
    first = tmp_path / "root" / "first"
    shutil.copytree(folder_of(addon, learned), first / "project")
    learned.karf.project = str(first / "project")
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    bpy.ops.wm.save_as_mainfile(filepath=str(first / "shot.blend"))
    assert learned.karf.project == "//project"
    return learned


@pytest.mark.parametrize("as_copy", [False, True])
def test_saving_elsewhere_never_loads_another_projects_swatches(bpy, addon, beside, tmp_path, as_copy):
    project, before = folder_of(addon, beside), colors(bpy)
    # where the relative path from root/deep/er/ to the project leads from root/first/
    decoy = tmp_path / "first" / "project"
    decoy.mkdir(parents=True)
    content = {"schema": "karf-palette/1", "objects": [{"name": "decoy", "colors": [[0, 0, 0], [1, 0, 0]]}]}
    (decoy / "palette.json").write_text(json.dumps(content))
    (tmp_path / "root" / "deep" / "er").mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "root" / "deep" / "er" / "shot.blend"), copy=as_copy)
    assert colors(bpy) == before and folder_of(addon, beside) == project


def test_failed_save_leaves_paths_unchanged(bpy, beside, tmp_path):
    before = colors(bpy)
    with pytest.raises(RuntimeError, match="Cannot open file"):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "no such folder" / "shot.blend"))
    assert beside.karf.project == "//project" and colors(bpy) == before
