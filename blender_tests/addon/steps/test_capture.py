"""Importing a capture: the camera rig, project folders, held-out views, checks and rejected files."""

import json
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest


def test_import_creates_a_camera_with_a_photo_per_view(bpy, addon, scene, capture_folder, tmp_path):
    assert bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project")) == {"FINISHED"}
    cameras = {camera.karf_view: camera for camera in scene.karf.rig.children}
    assert sorted(cameras) == ["photo_0", "photo_1", "photo_2"]
    for view in addon.captures.of(scene).views:
        camera = cameras[view.name]
        np.testing.assert_allclose(np.array(camera.matrix_world), view.camera.camera_to_world, atol=1e-6)
        image = camera.data.background_images[0].image
        assert bpy.path.abspath(image.filepath) == str(capture_folder / "images" / f"{view.name}.png")
    assert scene.camera.karf_view == scene.karf.active_view == "photo_0"
    assert (scene.render.resolution_x, scene.render.resolution_y) == (24, 16)
    aspect = scene.render.pixel_aspect_x / scene.render.pixel_aspect_y
    assert aspect == pytest.approx(28 / 30)  # fx 30, fy 28: tall pixels
    bpy.ops.karf.look_through(view="photo_2")
    assert scene.camera.karf_view == "photo_2"


def test_import_options_change_the_rig_but_not_the_pinholes(bpy, addon, scene, capture_folder, tmp_path):
    options = {"orientation": "UPRIGHT", "size": 10.0, "photos": False, "camera_size": 5.0}
    bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project"), **options)
    capture, cameras = addon.captures.of(scene), scene.karf.rig.children
    positions = np.array([camera.matrix_world.translation for camera in cameras])
    assert np.linalg.norm(np.ptp(positions, axis=0)) > 7  # the rig turned the bounding box
    assert scene.karf.rig.scale.x == pytest.approx(10 / addon.cameras.extent_of(capture))
    for camera in cameras:
        assert not camera.data.background_images and camera.data.display_size == pytest.approx(0.5)
        found = addon.lens.pinhole(scene, camera).camera_to_world
        np.testing.assert_allclose(found, capture.view(camera.karf_view).camera.camera_to_world, atol=1e-5)
    properties = bpy.ops.karf.import_capture.get_rna_type().properties
    kept = {each.identifier for each in properties if not (each.is_hidden or each.is_skip_save)} - {"rna_type"}
    assert kept == {"orientation", "size", "points", "photos", "camera_size"}


def test_unreadable_photo_keeps_all_cameras(addon, scene, capture_folder):
    capture = addon.engine_api.open_capture(capture_folder)
    capture.views[1].image.unlink()
    capture.views[1].image.mkdir()
    cameras = [item for item in addon.cameras.build(capture, "pots", scene).children if item.type == "CAMERA"]
    shown = {camera.karf_view: bool(camera.data.background_images) for camera in cameras}
    assert shown == {"photo_0": True, "photo_1": False, "photo_2": True}


def test_panoramas_name_the_command_that_converts_them(bpy, addon, scene, tmp_path):
    frame = {"file_path": "360.png", "camera_model": "EQUIRECTANGULAR", "transform_matrix": np.eye(4).tolist()}
    (tmp_path / "transforms.json").write_text(json.dumps({"frames": [frame]}))
    addon.images.write_png(tmp_path / "360.png", np.zeros((4, 8, 3), np.float32))
    with pytest.raises(RuntimeError, match=r"360-degree photos.*karf pinhole .*--out"):
        bpy.ops.karf.import_capture(filepath=str(tmp_path), project=str(tmp_path / "project"))
    assert scene.karf.rig is None


@pytest.mark.parametrize("name", ["nowhere", "notes.txt", "weights.bin", "table.npy", "settings.json"])
def test_files_without_a_capture_are_rejected_and_change_nothing(bpy, scene, tmp_path, name):
    if "." in name:
        (tmp_path / name).write_text('{"nothing": "here"}')
    with pytest.raises(RuntimeError, match=rf"{name}.*\."):
        bpy.ops.karf.import_capture("INVOKE_DEFAULT", filepath=str(tmp_path / name))
    assert not bpy.data.cameras and scene.karf.rig is None and scene.karf.project == ""


def test_failing_rig_leaves_nothing_behind(bpy, addon, scene, capture_folder, monkeypatch):
    monkeypatch.setattr(addon.cameras, "_set_background", Mock(side_effect=RuntimeError("disk gone")))
    with pytest.raises(RuntimeError, match="disk gone"):
        addon.steps.import_capture(scene, capture_folder, "project")
    assert not bpy.data.objects and not bpy.data.collections


@pytest.mark.parametrize("moved", [0.0, 0.5])
def test_import_removes_only_an_untouched_default_cube(bpy, addon, capture_folder, tmp_path, moved):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.objects["Cube"].location.x = moved
    bpy.ops.ed.undo_push(message="before")
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert ("Cube" in bpy.data.objects) == bool(moved)
    assert {"Camera", "Light"} <= set(bpy.data.objects.keys())
    bpy.ops.ed.undo_push(message="import")
    bpy.ops.ed.undo()
    assert not bpy.context.scene.karf.project and bpy.data.cameras.keys() == ["Camera"]


def test_default_project_folder_depends_on_the_saved_file(bpy, addon, scene, capture_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(
        bpy.utils, "extension_path_user", lambda package, path, create: str(tmp_path / package.split(".")[-1] / path)
    )
    addon.steps.import_capture(scene, capture_folder)
    assert addon.folders.project_of(scene).folder == tmp_path / "karf" / "projects" / "pots"
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    addon.steps.import_capture(bpy.context.scene, capture_folder)
    assert bpy.context.scene.karf.project == "//pots_karf"
    assert addon.folders.project_of(bpy.context.scene).folder == tmp_path / "pots_karf"


@pytest.mark.parametrize("file", ["", "transforms.json"])
def test_reimporting_a_capture_keeps_project_and_edits(addon, learned, capture_folder, file):
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    project = addon.folders.project_of(learned).folder
    addon.steps.import_capture(learned, capture_folder / file)
    assert addon.folders.project_of(learned).folder == project
    assert learned.karf.objects["pot"].swatches[1].color[:] == (0.25, 0.5, 0.75)


def test_saving_keeps_project_paths_relative_and_valid(bpy, addon, project_scene, tmp_path):
    for folder, is_copy, path in (("a", False, "//../project"), ("b/c", False, "//../../project"), ("d", True, None)):
        file = tmp_path / folder / "shot.blend"
        file.parent.mkdir(parents=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=is_copy)
        assert project_scene.karf.project == (path or "//../../project")
        assert addon.folders.project_of(project_scene).folder == tmp_path / "project"
    for folder in ("b/c", "d"):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / folder / "shot.blend"))
        assert addon.folders.project_of(bpy.context.scene).folder == tmp_path / "project"


def test_importing_a_learned_project_loads_swatches_and_masks(bpy, addon, learned, capture_folder):
    project = addon.folders.project_of(learned)
    (project.masks_folder / "pot").mkdir(parents=True)
    bpy.ops.wm.read_homefile(use_empty=True)
    addon.steps.import_capture(bpy.context.scene, capture_folder, project.folder)
    karf = bpy.context.scene.karf
    assert karf.objects.keys() == ["lid", "pot"]
    assert addon.folders.absolute(karf.masks) == project.masks_folder


def test_finished_stages_follow_the_project(addon, project_scene):
    assert addon.disk.read(project_scene).stages == frozenset()
    addon.steps.learn_scene(project_scene).wait()
    assert addon.disk.read(project_scene).stages == {"geometry"}
    addon.steps.extract_palette(project_scene).wait()
    assert addon.disk.read(project_scene).stages == {"geometry", "palette", "recoloring"}


def test_found_poses_create_a_project_beside_the_file(bpy, addon, scene, capture_folder, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.ops.karf.find_poses(filepath=str(capture_folder / "images")) == {"FINISHED"}
    assert scene.karf.views.keys() == ["photo_0", "photo_1", "photo_2"]
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf" / "capture"
    addon.steps.find_poses(scene, capture_folder / "images").wait()
    assert addon.folders.absolute(scene.karf.project) == tmp_path / "images_karf_2"
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf_2" / "capture"


def test_dropped_camera_file_is_imported_and_a_folder_ignored(bpy, scene, capture_folder):
    def drop(path):
        window = bpy.context.window_manager.windows[0]
        area = next(each for each in window.screen.areas if each.type == "VIEW_3D")
        with bpy.context.temp_override(window=window, area=area):
            files = [{"name": path.name}]
            return bpy.ops.wm.drop_import_file("INVOKE_DEFAULT", directory=f"{path.parent}/", files=files)

    handler = bpy.types.KARF_FH_capture
    assert handler.bl_import_operator == "karf.import_capture"
    assert set(handler.bl_file_extensions.split(";")) == {".json", ".npy", ".bin", ".txt"}
    assert drop(capture_folder) == {"CANCELLED"} and not len(scene.karf.views)
    assert drop(capture_folder / "transforms.json") == {"FINISHED"} and len(scene.karf.views) == 3


def test_image_editor_accepts_captures_before_learning_and_edits_after(bpy, learned):
    def takes(handler, area):
        context = SimpleNamespace(area=SimpleNamespace(type=area), scene=learned)
        return getattr(bpy.types, handler).poll_drop.__func__(None, context)

    for is_learned in (True, False):
        assert takes("KARF_FH_capture", "VIEW_3D")
        assert takes("KARF_FH_capture", "IMAGE_EDITOR") is not is_learned
        assert takes("KARF_FH_edit", "IMAGE_EDITOR") is is_learned
        learned.karf.objects.clear()


def test_holdout_option_sets_the_held_out_views(bpy, addon, project_scene, capture_folder):
    def splits():
        return [view.split for view in project_scene.karf.views]

    assert splits() == ["train"] * 3 and project_scene.karf.holdout == 0
    bpy.ops.karf.import_capture(filepath=str(capture_folder), holdout=2)
    assert splits() == ["test", "train", "test"] and project_scene.karf.holdout == 2
    (request,) = addon.steps.learn_scene(project_scene).requests
    assert request.options["holdout"] == 2
    project = addon.folders.project_of(project_scene)
    project.create(str(capture_folder))
    project.finish("geometry", "fingerprint", holdout=3)
    bpy.ops.karf.import_capture(filepath=str(capture_folder))
    assert splits() == ["test", "train", "train"]  # as the project was learned


def test_capture_advice_stays_until_another_capture(bpy, addon, project_scene, capture_folder, two_splits, tmp_path):
    karf = project_scene.karf
    assert bpy.ops.karf.check_capture() == {"FINISHED"}
    assert karf.is_poor and karf.advice.splitlines() == [
        "3 photos are too few here: take more above.",
        "Less sharp than the photos beside them: photo_1.",
    ]
    path = addon.folders.project_of(project_scene).folder / "inspection" / "more_photos.png"
    assert path.is_file() and bpy.data.images["KaRF more photos"].filepath == str(path)
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}  # advice blocks nothing
    assert "geometry" in addon.disk.read(project_scene).stages
    (tmp_path / "masks").mkdir()
    karf.masks = str(tmp_path / "masks")
    addon.steps.import_capture(project_scene, capture_folder)
    assert karf.advice and karf.masks
    addon.steps.check_capture(project_scene)
    assert not karf.is_poor  # the check includes the masks
    addon.steps.import_capture(project_scene, two_splits, tmp_path / "other")
    assert karf.advice == karf.masks == ""


@pytest.mark.parametrize(("small", "chosen", "preset"), [(24, "", "demo"), (16, "", "fast"), (16, "fine", "fine")])
def test_import_proposes_a_preset_by_the_size_of_the_photos(
    addon, scene, capture_folder, tmp_path, monkeypatch, small, chosen, preset
):
    monkeypatch.setattr(addon.steps.capture, "SMALL", small)
    if chosen:
        scene.karf.preset = chosen
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    assert scene.karf.preset == preset
