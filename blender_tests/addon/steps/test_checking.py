"""The capture checked before it is learned: what the panel says, what the Image Editor shows, and that nothing is blocked."""

import pytest


@pytest.fixture
def checked(bpy, project_scene):
    assert bpy.ops.karf.check_capture() == {"FINISHED"}
    return project_scene


def test_the_engines_advice_stands_in_the_panel(checked):
    assert checked.karf.is_poor
    assert checked.karf.advice.splitlines() == [
        "3 photos are too few here: take more above.",
        "Less sharp than the photos beside them: photo_1.",
    ]


def test_the_map_is_kept_in_the_project_and_shown(bpy, addon, checked):
    path = addon.folders.project_of(checked).folder / "inspection" / "more_photos.png"
    assert path.is_file() and bpy.data.images["KaRF more photos"].filepath == str(path)


def test_a_poor_capture_is_learned_all_the_same(bpy, addon, checked):
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}
    assert "geometry" in addon.contents.finished_stages(checked)


def test_another_capture_is_not_said_to_be_poor(addon, checked, two_splits, tmp_path):
    addon.steps.import_capture(checked, two_splits, tmp_path / "other")
    assert not checked.karf.is_poor and checked.karf.advice == ""


def test_the_same_capture_imported_again_keeps_its_advice(addon, checked, capture_folder):
    addon.steps.import_capture(checked, capture_folder)
    assert checked.karf.advice


def test_masks_that_were_drawn_are_looked_at_too(bpy, addon, checked, tmp_path):
    (tmp_path / "masks").mkdir()
    checked.karf.masks = str(tmp_path / "masks")
    addon.steps.check_capture(checked)
    assert not checked.karf.is_poor


def test_without_a_capture_it_is_greyed_out(bpy, scene):
    assert not bpy.ops.karf.check_capture.poll()
