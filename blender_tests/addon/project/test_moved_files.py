"""A .blend that moves with its folder, or whose scene goes to another file, finds its photos, project and capture."""

import shutil
from pathlib import Path

import pytest


def absolute(bpy, image):
    return Path(bpy.path.abspath(image.filepath, library=image.library))


def photos(addon, scene):
    return list(addon.image_paths._photos(scene))


@pytest.fixture
def relative_paths(bpy, addon):
    """Set the user's preference; it is on before and after the test."""

    def choose(is_on):
        bpy.context.preferences.filepaths.use_relative_paths = is_on

    yield choose
    choose(True)


@pytest.fixture
def job(bpy, addon, capture_folder, learned, tmp_path):
    """The folder job/ with a learned project, its capture and job/shot.blend, saved before the capture was imported."""
    folder = tmp_path / "job"
    folder.mkdir()
    project = addon.folders.project_of(learned).folder
    bpy.ops.wm.read_homefile(use_empty=True)
    project.rename(folder / "project")
    capture_folder.rename(folder / "pots")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    addon.steps.import_capture(bpy.context.scene, folder / "pots", folder / "project")
    addon.steps.show_photo(bpy.context.scene)
    return folder


def make_absolute(bpy, addon):
    """Save the photos' paths as earlier versions did."""
    for image in photos(addon, bpy.context.scene):
        image.filepath_raw = str(absolute(bpy, image))


def save_and_move(bpy, job, target):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True)
    job.rename(target)
    bpy.ops.wm.open_mainfile(filepath=str(target / "shot.blend"))
    return bpy.context.scene


def test_file_moved_with_its_folder_finds_everything(bpy, addon, job, tmp_path):
    assert {image.filepath[:2] for image in photos(addon, bpy.context.scene)} == {"//"}
    scene = save_and_move(bpy, job, tmp_path / "moved")
    assert [absolute(bpy, image).parent for image in photos(addon, scene)] == [tmp_path / "moved/pots/images"] * 4
    assert all(absolute(bpy, image).is_file() for image in photos(addon, scene))
    assert addon.captures.of(scene).source == tmp_path / "moved/pots"
    assert addon.folders.project_of(scene).folder == tmp_path / "moved/project"
    assert not addon.progress.state().warnings
    assert addon.steps.show_view(scene, "photo_1").wait().size[0] == 24


@pytest.mark.parametrize("old", ["/home/ann/job/pots/images/", r"C:\Users\ann\job\pots\images" + "\\"])
def test_absolute_paths_of_another_machine_are_found_in_the_capture(bpy, addon, job, tmp_path, relative_paths, old):
    relative_paths(False)  # else the save would make them relative
    for image in photos(addon, bpy.context.scene):
        image.filepath_raw = old + Path(image.filepath).name
    scene = save_and_move(bpy, job, tmp_path / "moved")
    assert [absolute(bpy, image).parent for image in photos(addon, scene)] == [tmp_path / "moved/pots/images"] * 4
    assert not addon.progress.state().warnings


def test_copied_folder_uses_its_own_photos(bpy, addon, job, tmp_path, relative_paths):
    relative_paths(False)
    make_absolute(bpy, addon)
    bpy.ops.wm.save_mainfile()
    relative_paths(True)
    shutil.copytree(job, tmp_path / "copy")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "copy" / "shot.blend"))
    assert {image.filepath[:7] for image in photos(addon, bpy.context.scene)} == {"//pots/"}


def test_saving_makes_absolute_paths_of_photos_relative(bpy, addon, job, tmp_path):
    make_absolute(bpy, addon)
    scene = save_and_move(bpy, job, tmp_path / "moved")
    assert {image.filepath[:7] for image in photos(addon, scene)} == {"//pots/"}


def test_relative_paths_preference_is_respected(bpy, addon, job, tmp_path, relative_paths):
    relative_paths(False)
    bpy.ops.wm.save_mainfile()
    scene = bpy.context.scene
    assert scene.karf.project == "//project" and {i.filepath[:2] for i in photos(addon, scene)} == {"//"}
    bpy.data.batch_remove(photos(addon, scene))
    addon.steps.import_capture(scene, job / "pots", job / "project")
    assert scene.karf.project == str(job / "project")
    bpy.ops.wm.save_mainfile()
    assert scene.karf.project == str(job / "project")
    assert photos(addon, scene)[0].filepath == str(job / "pots/images/photo_0.png")


def test_missing_photos_are_reported_on_load(bpy, addon, job, tmp_path):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True)
    (job / "pots").rename(tmp_path / "elsewhere")
    bpy.ops.wm.open_mainfile(filepath=str(job / "shot.blend"))
    assert f"missing, such as {job / 'pots'}." in addon.progress.state().warnings


@pytest.mark.parametrize("is_linked", [True, False])
def test_linked_or_appended_scene_finds_everything(bpy, addon, job, tmp_path, is_linked):
    if not is_linked and not hasattr(bpy.app.handlers, "blend_import_post"):
        pytest.skip("this Blender does not tell where a scene comes from")
    save_and_move(bpy, job, tmp_path / "moved")
    bpy.ops.wm.read_homefile(use_empty=True)
    (tmp_path / "film").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film" / "film.blend"))
    with bpy.data.libraries.load(str(tmp_path / "moved" / "shot.blend"), link=is_linked) as (found, wanted):
        wanted.scenes = found.scenes
    (scene,) = wanted.scenes
    assert scene.karf.project == ("//project" if is_linked else "//../moved/project")
    assert all(absolute(bpy, image).is_file() for image in photos(addon, scene))
    assert addon.disk.read(scene).stages
    assert addon.steps.show_view(scene, "photo_1").wait().size[0] == 24
    bpy.ops.wm.save_mainfile()
    assert addon.folders.project_of(scene).folder == tmp_path / "moved/project"
