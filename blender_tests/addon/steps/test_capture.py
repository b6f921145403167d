"""Importing a capture: the rig, what the scene remembers, and refusals."""

from types import SimpleNamespace

import numpy as np
import pytest


@pytest.fixture
def imported(bpy, addon, scene, capture_folder, tmp_path):
    assert bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project")) == {"FINISHED"}
    return scene


def test_there_is_a_camera_with_its_photo_for_every_view(bpy, addon, imported, capture_folder):
    cameras = imported.karf.rig.children
    assert sorted(camera.karf_view for camera in cameras) == ["photo_0", "photo_1", "photo_2"]
    for camera in cameras:
        image = camera.data.background_images[0].image
        assert bpy.path.abspath(image.filepath) == str(capture_folder / "images" / f"{camera.karf_view}.png")


def test_cameras_stand_where_the_capture_has_them(addon, imported):
    for view in addon.captures.of(imported).views:
        matrix = addon.cameras.camera_of(imported, view.name).matrix_world
        np.testing.assert_allclose(np.array(matrix), view.camera.camera_to_world, atol=1e-6)


def test_the_scene_looks_through_the_first_view_at_its_size(imported):
    assert imported.camera.karf_view == imported.karf.active_view == "photo_0"
    assert (imported.render.resolution_x, imported.render.resolution_y) == (24, 16)
    aspect = imported.render.pixel_aspect_x / imported.render.pixel_aspect_y
    assert aspect == pytest.approx(28 / 30)  # fx 30, fy 28: pixels are higher than wide


def test_looking_through_another_view_changes_the_camera(bpy, imported):
    bpy.ops.karf.look_through(view="photo_2")
    assert imported.camera.karf_view == "photo_2"


def test_a_missing_capture_is_refused_in_a_sentence_and_leaves_nothing_behind(bpy, scene, tmp_path):
    with pytest.raises(RuntimeError, match="nowhere does not exist"):
        bpy.ops.karf.import_capture(filepath=str(tmp_path / "nowhere"))
    assert not bpy.data.cameras and scene.karf.rig is None and scene.karf.project == ""


def test_a_rig_that_cannot_be_built_leaves_nothing_behind(bpy, addon, scene, capture_folder, monkeypatch):
    def fail(data, photo):
        raise RuntimeError("disk gone")

    monkeypatch.setattr(addon.cameras, "_set_background", fail)
    with pytest.raises(RuntimeError, match="disk gone"):
        addon.steps.import_capture(scene, capture_folder, "project")
    assert not bpy.data.objects and not bpy.data.collections


@pytest.mark.parametrize("moved", [0.0, 0.5])
def test_blenders_own_cube_leaves_a_new_file_and_one_that_was_touched_stays(
    bpy, addon, capture_folder, tmp_path, moved
):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.objects["Cube"].location.x = moved
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert ("Cube" in bpy.data.objects) == bool(moved)
    assert {"Camera", "Light"} <= set(bpy.data.objects.keys())


def test_undo_takes_the_import_back(bpy, addon, capture_folder, tmp_path):
    bpy.ops.ed.undo_push(message="before")
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    bpy.ops.ed.undo_push(message="import")
    bpy.ops.ed.undo()
    assert not bpy.context.scene.karf.project and not bpy.data.cameras


def test_without_a_project_a_saved_file_gets_one_beside_it(bpy, addon, scene, capture_folder, tmp_path):
    (tmp_path / "film").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film" / "shot.blend"))
    addon.steps.import_capture(scene, capture_folder)
    assert scene.karf.project == "//pots_karf"
    assert addon.folders.project_of(scene).folder == tmp_path / "film" / "pots_karf"


def test_an_unsaved_file_gets_a_project_in_the_extensions_own_folder(
    bpy, addon, scene, capture_folder, tmp_path, monkeypatch
):
    monkeypatch.setattr(
        bpy.utils,
        "extension_path_user",
        lambda package, path, create: str(tmp_path / package.rpartition(".")[2] / path),
    )
    addon.steps.import_capture(scene, capture_folder)
    assert addon.folders.project_of(scene).folder == tmp_path / "karf" / "projects" / "pots"


def test_importing_again_keeps_the_project_that_was_chosen(addon, imported, capture_folder, tmp_path):
    addon.steps.import_capture(imported, capture_folder)
    assert addon.folders.project_of(imported).folder == tmp_path / "project"


def test_a_capture_chosen_by_its_file_is_the_one_chosen_by_its_folder(addon, learned, capture_folder):
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    project = addon.folders.project_of(learned).folder
    addon.steps.import_capture(learned, capture_folder / "transforms.json")
    assert addon.folders.project_of(learned).folder == project
    assert learned.karf.objects["pot"].swatches[1].color[:] == (0.25, 0.5, 0.75)


def test_saving_makes_paths_relative_and_saving_elsewhere_keeps_them_right(bpy, addon, imported, tmp_path):
    first, second = tmp_path / "a" / "shot.blend", tmp_path / "b" / "c" / "shot.blend"
    first.parent.mkdir()
    second.parent.mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(first))
    assert imported.karf.project == "//../project"
    bpy.ops.wm.save_as_mainfile(filepath=str(second))
    assert imported.karf.project == "//../../project"
    bpy.ops.wm.open_mainfile(filepath=str(second))
    assert addon.folders.project_of(bpy.context.scene).folder == tmp_path / "project"


def test_saving_a_copy_leaves_the_open_file_right_and_the_copy_too(bpy, addon, imported, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b" / "c").mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a" / "shot.blend"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "b" / "c" / "copy.blend"), copy=True)
    assert addon.folders.project_of(imported).folder == tmp_path / "project"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b" / "c" / "copy.blend"))
    assert addon.folders.project_of(bpy.context.scene).folder == tmp_path / "project"


def test_a_learned_project_brings_its_swatches_and_masks(bpy, addon, learned, capture_folder):
    project = addon.folders.project_of(learned)
    (project.masks_folder / "pot").mkdir(parents=True)
    bpy.ops.wm.read_homefile(use_empty=True)
    addon.steps.import_capture(bpy.context.scene, capture_folder, project.folder)
    karf = bpy.context.scene.karf
    assert karf.objects.keys() == ["lid", "pot"]
    assert addon.folders.absolute(karf.masks) == project.masks_folder


def test_choosing_the_same_project_again_keeps_the_edits(addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    learned.karf.project = learned.karf.project + "/../project"
    assert learned.karf.objects["pot"].swatches[1].color[:] == (0.25, 0.5, 0.75)


def test_a_dropped_camera_file_is_imported_at_once(bpy, addon, scene, capture_folder, tmp_path):
    handler = bpy.types.KARF_FH_capture
    assert handler.bl_import_operator == "karf.import_capture"
    assert set(handler.bl_file_extensions.split(";")) == {".json", ".npy", ".bin", ".txt"}
    file = str(capture_folder / "transforms.json")
    assert bpy.ops.karf.import_capture("INVOKE_DEFAULT", filepath=file, project=str(tmp_path / "p")) == {"FINISHED"}
    assert len(scene.karf.views) == 3


def test_blender_brings_a_dropped_camera_file_and_knows_nothing_to_do_with_a_folder(bpy, scene, capture_folder):
    def drop(path):
        window = bpy.context.window_manager.windows[0]
        area = next(each for each in window.screen.areas if each.type == "VIEW_3D")
        with bpy.context.temp_override(window=window, area=area):
            files = [{"name": path.name}]
            return bpy.ops.wm.drop_import_file("INVOKE_DEFAULT", directory=f"{path.parent}/", files=files)

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


@pytest.mark.parametrize("name", ["notes.txt", "weights.bin", "table.npy", "settings.json"])
def test_a_dropped_file_of_another_kind_is_refused_in_a_sentence(bpy, scene, tmp_path, name):
    file = tmp_path / name
    file.write_text('{"nothing": "here"}')
    with pytest.raises(RuntimeError, match=rf"{name}.*\."):
        bpy.ops.karf.import_capture("INVOKE_DEFAULT", filepath=str(file))
    assert not bpy.data.cameras and scene.karf.project == ""


def test_the_import_can_be_a_preset_without_its_paths(bpy, addon):
    properties = bpy.ops.karf.import_capture.get_rna_type().properties
    kept = {each.identifier for each in properties if not (each.is_hidden or each.is_skip_save)} - {"rna_type"}
    assert kept == {"orientation", "size", "points", "photos", "camera_size"}


def test_options_change_the_rig_and_never_the_pinholes(bpy, addon, scene, capture_folder, tmp_path):
    options = {"orientation": "UPRIGHT", "size": 10.0, "photos": False, "camera_size": 5.0}
    bpy.ops.karf.import_capture(filepath=str(capture_folder), project=str(tmp_path / "project"), **options)
    capture, cameras = addon.captures.of(scene), scene.karf.rig.children
    positions = np.array([camera.matrix_world.translation for camera in cameras])
    assert np.linalg.norm(np.ptp(positions, axis=0)) > 7  # the box was turned with the rig
    assert scene.karf.rig.scale.x == pytest.approx(10 / addon.cameras.extent_of(capture))
    for camera in cameras:
        assert not camera.data.background_images and camera.data.display_size == pytest.approx(0.5)
        found = addon.lens.pinhole(scene, camera)
        np.testing.assert_allclose(
            found.camera_to_world, capture.view(camera.karf_view).camera.camera_to_world, atol=1e-5
        )


def test_photos_without_poses_become_an_imported_capture(bpy, addon, scene, capture_folder, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.ops.karf.find_poses(filepath=str(capture_folder / "images")) == {"FINISHED"}
    assert addon.folders.absolute(scene.karf.project) == tmp_path / "images_karf"
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf" / "capture"
    assert scene.karf.views.keys() == ["photo_0", "photo_1", "photo_2"]


def test_poses_found_anew_leave_the_earlier_project_alone(bpy, addon, scene, capture_folder, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    addon.steps.find_poses(scene, capture_folder / "images").wait()
    addon.steps.find_poses(scene, capture_folder / "images").wait()
    assert addon.folders.absolute(scene.karf.capture) == tmp_path / "images_karf_2" / "capture"


def test_finished_stages_are_those_of_the_project_as_it_is_now(addon, imported):
    assert addon.disk.read(imported).stages == frozenset()
    addon.steps.learn_scene(imported).wait()
    assert addon.disk.read(imported).stages == {"geometry"}
    addon.steps.extract_palette(imported).wait()
    assert addon.disk.read(imported).stages == {"geometry", "palette", "recoloring"}


def test_a_photo_that_cannot_be_opened_leaves_the_cameras_standing(bpy, addon, scene, capture_folder):
    capture = addon.engine_api.open_capture(capture_folder)
    capture.views[1].image.unlink()
    capture.views[1].image.mkdir()
    rig = addon.cameras.build(capture, "pots", scene)
    shown = {
        camera.karf_view: bool(camera.data.background_images) for camera in rig.children if camera.type == "CAMERA"
    }
    assert shown == {"photo_0": True, "photo_1": False, "photo_2": True}


def test_masks_of_another_capture_leave_the_scene(addon, imported, capture_folder, two_splits, tmp_path):
    imported.karf.masks = str(tmp_path / "masks")
    addon.steps.import_capture(imported, capture_folder)
    assert imported.karf.masks, "imported again, it lost its own"
    addon.steps.import_capture(imported, two_splits)
    assert not imported.karf.masks


# --------------------------------------------------------------------------------------------------------- held-out photos
def test_all_photos_are_learned_from_unless_some_are_held_out(bpy, imported, capture_folder):
    assert [view.split for view in imported.karf.views] == ["train"] * 3 and imported.karf.holdout == 0
    bpy.ops.karf.import_capture(filepath=str(capture_folder), holdout=2)
    assert [view.split for view in imported.karf.views] == ["test", "train", "test"] and imported.karf.holdout == 2


def test_a_learned_project_keeps_what_it_was_learned_without(bpy, addon, imported, capture_folder):
    addon.folders.project_of(imported).create(str(capture_folder))
    addon.folders.project_of(imported).finish("geometry", "fingerprint", holdout=3)
    bpy.ops.karf.import_capture(filepath=str(capture_folder))
    assert [view.split for view in imported.karf.views] == ["test", "train", "train"]


def test_the_engine_is_told_what_is_held_out(bpy, addon, imported, capture_folder):
    bpy.ops.karf.import_capture(filepath=str(capture_folder), holdout=2)
    (request,) = addon.steps.learn_scene(imported).requests
    assert request.options["holdout"] == 2


# --- check -----------------------------------------------------------------------------------------------------------
@pytest.fixture
def checked(bpy, project_scene):
    assert bpy.ops.karf.check_capture() == {"FINISHED"}
    return project_scene


def test_the_engines_advice_and_its_map_are_shown_and_it_is_learned_all_the_same(bpy, addon, checked):
    assert checked.karf.is_poor
    assert checked.karf.advice.splitlines() == [
        "3 photos are too few here: take more above.",
        "Less sharp than the photos beside them: photo_1.",
    ]
    path = addon.folders.project_of(checked).folder / "inspection" / "more_photos.png"
    assert path.is_file() and bpy.data.images["KaRF more photos"].filepath == str(path)
    assert bpy.ops.karf.learn_scene() == {"FINISHED"}
    assert "geometry" in addon.disk.read(checked).stages


def test_the_same_capture_imported_again_keeps_its_advice_and_another_has_none(
    addon, checked, capture_folder, two_splits, tmp_path
):
    addon.steps.import_capture(checked, capture_folder)
    assert checked.karf.advice
    addon.steps.import_capture(checked, two_splits, tmp_path / "other")
    assert not checked.karf.is_poor and checked.karf.advice == ""


def test_masks_that_were_drawn_are_looked_at_too(bpy, addon, checked, tmp_path):
    (tmp_path / "masks").mkdir()
    checked.karf.masks = str(tmp_path / "masks")
    addon.steps.check_capture(checked)
    assert not checked.karf.is_poor


def test_without_a_capture_it_is_greyed_out(bpy, scene):
    assert not bpy.ops.karf.check_capture.poll()
