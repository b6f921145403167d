"""The result of a job goes only to the file, scene and project that started it."""

import pytest


@pytest.fixture
def poses(addon, scene, capture_folder):
    """The task that finds the camera poses of the scene's photos."""
    return addon.steps.find_poses(scene, capture_folder / "images")


def n_rigs(bpy):
    return len([item for item in bpy.data.objects if item.type == "EMPTY"])


def test_poses_stay_on_disk_after_another_file_opens(bpy, addon, poses):
    bpy.ops.wm.read_homefile(use_empty=True)
    addon.runner.wait(poses)
    out = poses.requests[0].options["out"]
    assert n_rigs(bpy) == 0 and not bpy.context.scene.karf.project
    assert out in addon.progress.state().warnings and addon.engine_api.open_capture(out).views


@pytest.mark.parametrize("is_deleted", [False, True])
def test_poses_go_only_to_their_renamed_scene(bpy, addon, scene, poses, is_deleted):
    scene.name = "renamed"
    other = bpy.data.scenes.new("Scene")
    bpy.ops.ed.undo_push(message="renamed")
    bpy.context.window.scene = other
    if is_deleted:
        bpy.data.scenes.remove(scene)
    addon.runner.wait(poses)
    assert not other.karf.project and n_rigs(bpy) == (0 if is_deleted else 1)
    assert "import" in addon.progress.state().warnings if is_deleted else bpy.data.scenes["renamed"].karf.project


def test_poses_do_not_replace_a_project_chosen_meanwhile(bpy, addon, scene, poses, capture_folder, tmp_path):
    addon.steps.import_capture(scene, capture_folder, tmp_path / "chosen")
    addon.runner.wait(poses)
    assert addon.folders.project_of(scene).folder == tmp_path / "chosen" and n_rigs(bpy) == 1


def test_palettes_do_not_enter_a_file_opened_meanwhile(bpy, addon, learned):
    project = addon.folders.project_of(learned).folder
    task = addon.steps.extract_palette(learned)
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.karf.project = str(project)
    scene.karf.objects.clear()
    addon.runner.wait(task)
    assert not scene.karf.objects and scene.karf.result is None
    assert addon.progress.state().warnings.count(str(project)) == 1


def test_palettes_do_not_enter_a_scene_with_another_project(addon, learned, tmp_path):
    task = addon.steps.extract_palette(learned)
    addon.steps.set_swatch(learned, "pot", 1, "#102030")
    learned.karf.project = str(tmp_path / "elsewhere")
    before = [tuple(swatch.color) for swatch in learned.karf.objects["pot"].swatches]
    addon.runner.wait(task)
    assert [tuple(swatch.color) for swatch in learned.karf.objects["pot"].swatches] == before
    assert "result is in" in addon.progress.state().warnings


def test_job_label_names_its_owner_even_after_undo(bpy, addon, scene, poses):
    bpy.ops.ed.undo_push(message="before")
    scene.karf.nerf = "mug.tar"
    bpy.ops.ed.undo_push(message="nerf")
    bpy.ops.ed.undo()
    assert poses.owner.find() == bpy.context.scene and poses.label == "Find Camera Poses"
    bpy.data.scenes.new("other")
    assert poses.label == f"Find Camera Poses ({bpy.context.scene.name})"
    bpy.ops.wm.read_homefile(use_empty=True)
    assert poses.label == "Find Camera Poses (of another file)"
