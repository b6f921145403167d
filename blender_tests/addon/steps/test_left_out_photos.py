"""Photos are left out of learning by a checkbox or as blurred; a learned project shows which it was learned without."""

import pytest


def left_out(scene):
    return [view.name for view in scene.karf.views if not view.is_learned]


def wanted(addon, scene):
    return addon.steps.learn_scene(scene).requests[0].options["without"]


def test_unchecked_photo_is_left_out(bpy, addon, project_scene, reopen):
    assert left_out(project_scene) == wanted(addon, project_scene) == []
    project_scene.karf.views["photo_2"].is_learned = False
    assert wanted(addon, project_scene) == ["photo_2"]
    assert wanted(addon, reopen()) == ["photo_2"]


def test_leave_out_blurred_needs_a_check_and_can_be_undone(bpy, addon, project_scene):
    assert not bpy.ops.karf.leave_out_blurred.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="Check the capture first"):
        addon.steps.leave_out_blurred(project_scene)
    bpy.ops.karf.check_capture()
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.karf.leave_out_blurred() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Leave Out Blurred")
    assert left_out(bpy.context.scene) == ["photo_1"]
    bpy.ops.ed.undo()
    assert left_out(bpy.context.scene) == []


def test_left_out_photos_are_not_checked(addon, project_scene, monkeypatch):
    asked = []
    monkeypatch.setattr(addon.queries, "send", lambda scene, kind, options, *_: asked.append(options["without"]))
    project_scene.karf.views["photo_0"].is_learned = False
    addon.steps.check_capture(project_scene)
    assert asked == [["photo_0"]]


def test_learned_project_shows_left_out_photos_unchecked(bpy, addon, project_scene, capture_folder, tmp_path):
    project_scene.karf.views["photo_1"].is_learned = False
    addon.steps.learn_scene(project_scene).wait()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    addon.steps.import_capture(scene, capture_folder, tmp_path / "other")
    assert left_out(scene) == []
    scene.karf.project = str(tmp_path / "project")
    assert left_out(scene) == ["photo_1"]
    addon.steps.import_capture(scene, capture_folder)
    assert left_out(scene) == ["photo_1"]


def test_choice_survives_import_and_outdates_the_scene(addon, project_scene, capture_folder):
    addon.steps.learn_scene(project_scene).wait()
    assert addon.states.state_of(project_scene, "learn").kind != addon.states.STALE
    project_scene.karf.views["photo_1"].is_learned = False
    addon.steps.import_capture(project_scene, capture_folder)
    assert left_out(project_scene) == ["photo_1"]
    assert "other photos" in addon.states.state_of(project_scene, "learn").reason


def test_click_in_the_list_shows_the_photo(project_scene):
    karf = project_scene.karf
    karf.active_number = 2
    assert karf.active_view == "photo_2" and karf.active_number == 2
