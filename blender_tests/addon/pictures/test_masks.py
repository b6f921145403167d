"""Painting a coarse mask over a photo."""

import numpy as np
import pytest


@pytest.fixture
def imported(bpy, addon, capture_folder, tmp_path):
    addon.headless.import_capture(capture_folder, tmp_path / "project")
    return bpy.context.scene


def paint(addon, image, rows, columns, color=(1.0, 0.0, 1.0)):
    """Stroke a rectangle of the picture (first row at the top)."""
    height, width = image.size[1], image.size[0]
    buffer = addon.images.blank(width, height)
    addon.images.upright(buffer)[:] = addon.images.pixels(image)[..., :3]
    addon.images.upright(buffer)[rows, columns] = color
    addon.images.upload(image, buffer)


def test_what_is_painted_over_the_photo_is_the_mask(bpy, addon, imported):
    assert bpy.ops.karf.paint_mask(object_name="pot") == {"FINISHED"}
    image = imported.karf.mask_image
    assert tuple(image.size) == (24, 16)
    paint(addon, image, slice(2, 5), slice(10, 20))
    assert bpy.ops.karf.save_mask() == {"FINISHED"}
    file = addon.folders.project_of(imported).masks_folder / "pot" / "photo_0.png"
    expected = np.zeros((16, 24, 3))
    expected[2:5, 10:20] = 1
    np.testing.assert_array_equal(addon.images.read_picture(file), expected)
    assert addon.folders.absolute(imported.karf.masks) == file.parents[1]


def test_the_picture_to_paint_on_is_the_photo_itself(bpy, addon, imported, capture_folder):
    bpy.ops.karf.paint_mask(object_name="pot")
    photo = addon.images.read_picture(capture_folder / "images" / "photo_0.png")
    np.testing.assert_array_equal(addon.images.pixels(imported.karf.mask_image)[..., :3], photo)


def test_a_mask_joins_those_of_the_chosen_folder(bpy, addon, imported, tmp_path):
    addon.images.write_png(tmp_path / "given" / "lid" / "photo_1.png", np.ones((16, 24, 3)))
    imported.karf.masks = str(tmp_path / "given")
    bpy.ops.karf.paint_mask(object_name="pot")
    paint(addon, imported.karf.mask_image, slice(0, 4), slice(0, 4))
    bpy.ops.karf.save_mask()
    assert (tmp_path / "given" / "pot" / "photo_0.png").exists()
    assert addon.contents.mask_counts(imported) == {"lid": 1, "pot": 1}


def test_a_half_painted_mask_survives_saving_and_loading(bpy, addon, imported, tmp_path):
    bpy.ops.karf.paint_mask(object_name="pot")
    paint(addon, imported.karf.mask_image, slice(2, 5), slice(10, 20))
    addon.headless.save(tmp_path / "shot.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    _, share = addon.steps.save_mask(bpy.context.scene)
    assert share == pytest.approx(30 / (16 * 24))


def test_an_unpainted_mask_is_refused(bpy, addon, imported):
    bpy.ops.karf.paint_mask(object_name="pot")
    with pytest.raises(RuntimeError, match="Nothing is painted on the photo of 'photo_0'"):
        bpy.ops.karf.save_mask()


@pytest.mark.parametrize("name", ["../pot", "aux", "con.left", "pot."])
def test_a_name_that_is_no_folder_on_every_system_is_refused(bpy, addon, imported, name):
    with pytest.raises(RuntimeError, match="no name for an object"):
        bpy.ops.karf.paint_mask(object_name=name)


def test_a_name_that_windows_takes_for_another_objects_is_refused(bpy, addon, imported, tmp_path):
    addon.images.write_png(tmp_path / "given" / "Pot" / "photo_1.png", np.ones((16, 24, 3)))
    imported.karf.masks = str(tmp_path / "given")
    with pytest.raises(RuntimeError, match="'pot' and the object 'Pot' would be one folder"):
        bpy.ops.karf.paint_mask(object_name="pot")
    assert bpy.ops.karf.paint_mask(object_name="Pot") == {"FINISHED"}


def test_painted_masks_segment_without_further_choice(bpy, addon, imported):
    addon.headless.learn_scene()
    addon.steps.paint_mask(imported, "pot")
    paint(addon, imported.karf.mask_image, slice(0, 4), slice(0, 4))
    addon.steps.save_mask(imported)
    addon.headless.segment()
    report = addon.folders.project_of(imported).segmentation_report.read_text()
    assert '"pot"' in report


def test_pixels_survive_the_way_to_a_file_and_back(addon, tmp_path):
    ramp = (np.arange(256, dtype=np.float32) / np.float32(255)).reshape(16, 16, 1).repeat(3, axis=2)
    addon.images.write_png(tmp_path / "ramp.png", ramp)
    written = addon.images.read_picture(tmp_path / "ramp.png")
    np.testing.assert_allclose(written * 255, ramp * 255, atol=1e-4)


def test_an_unreadable_picture_is_named(addon, tmp_path):
    (tmp_path / "broken.png").write_text("no picture")
    with pytest.raises(addon.engine_api.DataError, match=r"broken\.png"):
        addon.images.read_picture(tmp_path / "broken.png")
