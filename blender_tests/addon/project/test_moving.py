"""Saving and moving: a project goes beside its file, paths lead to the same places, and swatches stay the file's own."""

import json
import shutil

import numpy as np
import pytest


@pytest.fixture
def hidden(addon, learned, tmp_path, monkeypatch):
    """The learned scene with its project in the extension's own folder, which is one of the test's."""
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


def test_project_moves_next_to_its_file_which_is_saved(bpy, addon, saved, tmp_path):
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
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    old = folder_of(addon, saved)
    monkeypatch.setattr(addon.moving.shutil, "copytree", full)
    with pytest.raises(RuntimeError, match="No space left on device"):
        bpy.ops.karf.move_project()
    assert folder_of(addon, saved) == old and old.is_dir()
    assert sorted(path.name for path in (tmp_path / "desk").iterdir()) == ["shot.blend"]


def test_a_file_that_cannot_be_saved_still_finds_its_project(bpy, addon, saved, tmp_path):
    """Blender 4.2 moves a folder out of the file's way, and saves: then all is as after any move."""
    old = folder_of(addon, saved)
    shutil.rmtree(tmp_path / "desk")
    (tmp_path / "desk").mkdir()
    (tmp_path / "desk" / "shot.blend").mkdir()  # in the way of the file
    try:
        bpy.ops.karf.move_project()
    except RuntimeError as error:
        assert "could not be saved" in str(error)
        assert old.is_dir()
    else:
        assert (tmp_path / "desk" / "shot.blend").is_file()
        assert not old.exists() and folder_of(addon, saved) == tmp_path / "desk" / "pots_karf"
    assert addon.disk.is_prepared(saved)


def test_undo_across_the_move_finds_the_project_where_it_is(bpy, addon, saved, tmp_path):
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.karf.move_project()
    bpy.ops.ed.undo_push(message="Move Project")
    bpy.ops.ed.undo()
    assert folder_of(addon, bpy.context.scene) == tmp_path / "desk" / "pots_karf"


def test_shared_project_is_copied_and_nothing_is_overwritten(bpy, addon, saved, tmp_path):
    (tmp_path / "desk" / "pots_karf").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "desk" / "other.blend"))
    old = folder_of(addon, saved)
    bpy.ops.karf.move_project()
    assert old.is_dir() and folder_of(addon, saved) == tmp_path / "desk" / "pots_karf_2"


def test_question_is_asked_once_for_a_hidden_project(bpy, addon, saved):
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


# --- saving elsewhere ----------------------------------------------------------------------------------------------
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


def colors(scene):
    return {item.name: [tuple(swatch.color) for swatch in item.swatches] for item in scene.karf.objects}


@pytest.mark.parametrize("as_copy", [False, True])
def test_saving_elsewhere_never_brings_another_projects_swatches(bpy, addon, beside, tmp_path, as_copy):
    project, before = folder_of(addon, beside), colors(beside)
    # what the way from root/deep/er/ to the project names when it is followed from root/first/
    decoy = tmp_path / "first" / "project"
    decoy.mkdir(parents=True)
    content = {"schema": "karf-palette/1", "objects": [{"name": "decoy", "colors": [[0, 0, 0], [1, 0, 0]]}]}
    (decoy / "palette.json").write_text(json.dumps(content))
    (tmp_path / "root" / "deep" / "er").mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "root" / "deep" / "er" / "shot.blend"), copy=as_copy)
    assert colors(beside) == before and folder_of(addon, beside) == project


def test_a_save_that_fails_leaves_the_paths_as_they_were(bpy, beside, tmp_path):
    before = colors(beside)
    with pytest.raises(RuntimeError, match="Cannot open file"):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "no such folder" / "shot.blend"))
    assert beside.karf.project == "//project" and colors(beside) == before
