"""Importing a capture: the rig, what the scene remembers, and refusals."""

import json
from types import SimpleNamespace

import numpy as np
import pytest


@pytest.fixture
def imported(bpy, scene, capture_folder, tmp_path):
    assert bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project")) == {"FINISHED"}
    return scene


def splits(scene):
    return [view.split for view in scene.karf.views]


def test_every_view_has_a_camera_with_its_photo_and_the_scene_the_size_of_the_first(
    bpy, addon, imported, capture_folder
):
    cameras = {camera.karf_view: camera for camera in imported.karf.rig.children}
    assert sorted(cameras) == ["photo_0", "photo_1", "photo_2"]
    for view in addon.captures.of(imported).views:
        camera = cameras[view.name]
        np.testing.assert_allclose(np.array(camera.matrix_world), view.camera.camera_to_world, atol=1e-6)
        image = camera.data.background_images[0].image
        assert bpy.path.abspath(image.filepath) == str(capture_folder / "images" / f"{view.name}.png")
    assert imported.camera.karf_view == imported.karf.active_view == "photo_0"
    assert (imported.render.resolution_x, imported.render.resolution_y) == (24, 16)
    aspect = imported.render.pixel_aspect_x / imported.render.pixel_aspect_y
    assert aspect == pytest.approx(28 / 30)  # fx 30, fy 28: pixels are higher than wide
    bpy.ops.karf.look_through(view="photo_2")
    assert imported.camera.karf_view == "photo_2"


def test_import_options_change_the_rig_and_never_the_pinholes(bpy, addon, scene, capture_folder, tmp_path):
    options = {"orientation": "UPRIGHT", "size": 10.0, "photos": False, "camera_size": 5.0}
    bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project"), **options)
    capture, cameras = addon.captures.of(scene), scene.karf.rig.children
    positions = np.array([camera.matrix_world.translation for camera in cameras])
    assert np.linalg.norm(np.ptp(positions, axis=0)) > 7  # the box was turned with the rig
    assert scene.karf.rig.scale.x == pytest.approx(10 / addon.cameras.extent_of(capture))
    for camera in cameras:
        assert not camera.data.background_images and camera.data.display_size == pytest.approx(0.5)
        found = addon.lens.pinhole(scene, camera).camera_to_world
        np.testing.assert_allclose(found, capture.view(camera.karf_view).camera.camera_to_world, atol=1e-5)
    properties = bpy.ops.karf.import_capture.get_rna_type().properties
    kept = {each.identifier for each in properties if not (each.is_hidden or each.is_skip_save)} - {"rna_type"}
    assert kept == {"orientation", "size", "points", "photos", "camera_size"}


def test_a_photo_that_cannot_be_opened_leaves_the_cameras_standing(addon, scene, capture_folder):
    capture = addon.engine_api.open_capture(capture_folder)
    capture.views[1].image.unlink()
    capture.views[1].image.mkdir()
    cameras = [item for item in addon.cameras.build(capture, "pots", scene).children if item.type == "CAMERA"]
    shown = {camera.karf_view: bool(camera.data.background_images) for camera in cameras}
    assert shown == {"photo_0": True, "photo_1": False, "photo_2": True}


# --- refusals and undo -----------------------------------------------------------------------------------------------
def test_a_capture_of_360_degree_photos_names_the_command_that_converts_them(bpy, addon, scene, tmp_path):
    frame = {"file_path": "360.png", "camera_model": "EQUIRECTANGULAR", "transform_matrix": np.eye(4).tolist()}
    (tmp_path / "transforms.json").write_text(json.dumps({"frames": [frame]}))
    addon.images.write_png(tmp_path / "360.png", np.zeros((4, 8, 3), np.float32))
    with pytest.raises(RuntimeError, match=r"360-degree photos.*karf pinhole .*--out"):
        bpy.ops.karf.import_capture(filepath=str(tmp_path), project=str(tmp_path / "project"))
    assert scene.karf.rig is None


@pytest.mark.parametrize("name", ["nowhere", "notes.txt", "weights.bin", "table.npy", "settings.json"])
def test_what_is_no_capture_is_refused_in_a_sentence_and_leaves_nothing_behind(bpy, scene, tmp_path, name):
    if "." in name:
        (tmp_path / name).write_text('{"nothing": "here"}')
    with pytest.raises(RuntimeError, match=rf"{name}.*\."):
        bpy.ops.karf.import_capture("INVOKE_DEFAULT", filepath=str(tmp_path / name))
    assert not bpy.data.cameras and scene.karf.rig is None and scene.karf.project == ""


def test_a_rig_that_cannot_be_built_leaves_nothing_behind(bpy, addon, scene, capture_folder, monkeypatch):
    def fail(data, photo):
        raise RuntimeError("disk gone")

    monkeypatch.setattr(addon.cameras, "_set_background", fail)
    with pytest.raises(RuntimeError, match="disk gone"):
        addon.steps.import_capture(scene, capture_folder, "project")
    assert not bpy.data.objects and not bpy.data.collections


@pytest.mark.parametrize("moved", [0.0, 0.5])
def test_the_import_removes_an_untouched_default_cube_and_undo_brings_it_back(
    bpy, addon, capture_folder, tmp_path, moved
):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.objects["Cube"].location.x = moved
    bpy.ops.ed.undo_push(message="before")
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert ("Cube" in bpy.data.objects) == bool(moved)
    assert {"Camera", "Light"} <= set(bpy.data.objects.keys())
    bpy.ops.ed.undo_push(message="import")
    bpy.ops.ed.undo()
    assert not bpy.context.scene.karf.project and bpy.data.cameras.keys() == ["Camera"]


# --- the project -----------------------------------------------------------------------------------------------------
def test_the_default_project_folder(bpy, addon, scene, capture_folder, tmp_path, monkeypatch):
    def user_folder(package, path, create):
        return str(tmp_path / package.rpartition(".")[2] / path)

    monkeypatch.setattr(bpy.utils, "extension_path_user", user_folder)
    addon.steps.import_capture(scene, capture_folder)
    assert addon.folders.project_of(scene).folder == tmp_path / "karf" / "projects" / "pots"
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    scene = bpy.context.scene
    addon.steps.import_capture(scene, capture_folder)
    assert scene.karf.project == "//pots_karf"
    assert addon.folders.project_of(scene).folder == tmp_path / "pots_karf"


@pytest.mark.parametrize("file", ["", "transforms.json"])
def test_a_capture_imported_again_keeps_its_project_and_edits(addon, learned, capture_folder, file):
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    project = addon.folders.project_of(learned).folder
    addon.steps.import_capture(learned, capture_folder / file)
    assert addon.folders.project_of(learned).folder == project
    assert learned.karf.objects["pot"].swatches[1].color[:] == (0.25, 0.5, 0.75)


def test_saving_makes_paths_relative_and_saving_elsewhere_or_a_copy_keeps_them_right(bpy, addon, imported, tmp_path):
    for folder, is_copy, path in (("a", False, "//../project"), ("b/c", False, "//../../project"), ("d", True, None)):
        file = tmp_path / folder / "shot.blend"
        file.parent.mkdir(parents=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=is_copy)
        assert imported.karf.project == (path or "//../../project")
        assert addon.folders.project_of(imported).folder == tmp_path / "project"
    for folder in ("b/c", "d"):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / folder / "shot.blend"))
        assert addon.folders.project_of(bpy.context.scene).folder == tmp_path / "project"


def test_a_learned_project_brings_its_swatches_and_masks(bpy, addon, learned, capture_folder):
    project = addon.folders.project_of(learned)
    (project.masks_folder / "pot").mkdir(parents=True)
    bpy.ops.wm.read_homefile(use_empty=True)
    addon.steps.import_capture(bpy.context.scene, capture_folder, project.folder)
    karf = bpy.context.scene.karf
    assert karf.objects.keys() == ["lid", "pot"]
    assert addon.folders.absolute(karf.masks) == project.masks_folder


def test_finished_stages_are_those_of_the_project_as_it_is_now(addon, imported):
    assert addon.disk.read(imported).stages == frozenset()
    addon.steps.learn_scene(imported).wait()
    assert addon.disk.read(imported).stages == {"geometry"}
    addon.steps.extract_palette(imported).wait()
    assert addon.disk.read(imported).stages == {"geometry", "palette", "recoloring"}


def test_found_poses_get_a_new_project_beside_the_file(bpy, addon, scene, capture_folder, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.ops.karf.find_poses(filepath=str(capture_folder / "images")) == {"FINISHED"}
    assert scene.karf.views.keys() == ["photo_0", "photo_1", "photo_2"]
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf" / "capture"
    addon.steps.find_poses(scene, capture_folder / "images").wait()
    assert addon.folders.absolute(scene.karf.project) == tmp_path / "images_karf_2"
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf_2" / "capture"


# --- dropped files ---------------------------------------------------------------------------------------------------
def test_a_dropped_camera_file_is_imported_at_once_and_a_folder_is_nothing(bpy, scene, capture_folder):
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


def test_the_picture_takes_camera_files_until_there_are_swatches_then_edits(bpy, learned):
    def takes(handler, area):
        context = SimpleNamespace(area=SimpleNamespace(type=area), scene=learned)
        return getattr(bpy.types, handler).poll_drop.__func__(None, context)

    for is_learned in (True, False):
        assert takes("KARF_FH_capture", "VIEW_3D")
        assert takes("KARF_FH_capture", "IMAGE_EDITOR") is not is_learned
        assert takes("KARF_FH_edit", "IMAGE_EDITOR") is is_learned
        learned.karf.objects.clear()


# --- held-out photos -------------------------------------------------------------------------------------------------
def test_all_photos_are_learned_from_unless_some_are_held_out(bpy, addon, imported, capture_folder):
    assert splits(imported) == ["train"] * 3 and imported.karf.holdout == 0
    bpy.ops.karf.import_capture(filepath=str(capture_folder), holdout=2)
    assert splits(imported) == ["test", "train", "test"] and imported.karf.holdout == 2
    (request,) = addon.steps.learn_scene(imported).requests
    assert request.options["holdout"] == 2
    project = addon.folders.project_of(imported)
    project.create(str(capture_folder))
    project.finish("geometry", "fingerprint", holdout=3)
    bpy.ops.karf.import_capture(filepath=str(capture_folder))
    assert splits(imported) == ["test", "train", "train"]  # what it was learned without


# --- check -----------------------------------------------------------------------------------------------------------
def test_advice_belongs_to_the_capture(bpy, addon, project_scene, capture_folder, two_splits, tmp_path):
    karf = project_scene.karf
    assert bpy.ops.karf.check_capture() == {"FINISHED"}
    assert karf.is_poor and karf.advice.splitlines() == [
        "3 photos are too few here: take more above.",
        "Less sharp than the photos beside them: photo_1.",
    ]
    path = addon.folders.project_of(project_scene).folder / "inspection" / "more_photos.png"
    assert path.is_file() and bpy.data.images["KaRF more photos"].filepath == str(path)
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}  # all the same
    assert "geometry" in addon.disk.read(project_scene).stages
    (tmp_path / "masks").mkdir()
    karf.masks = str(tmp_path / "masks")
    addon.steps.import_capture(project_scene, capture_folder)
    assert karf.advice and karf.masks
    addon.steps.check_capture(project_scene)
    assert not karf.is_poor  # the drawn masks are looked at too
    addon.steps.import_capture(project_scene, two_splits, tmp_path / "other")
    assert karf.advice == karf.masks == ""
