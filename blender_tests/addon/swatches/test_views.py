"""Display modes of a view, the split view, mask overlays and the loupe."""

import numpy as np
import pytest

from .scenes import levels


@pytest.fixture
def pictures(addon, learned):
    """The photo, and the edited picture, which stays shown."""
    photo = levels(addon, learned)
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    edited = levels(addon, learned)
    assert (edited != photo).any()
    return photo, edited


def test_original_mode_shows_the_photo_but_saves_the_edit(addon, learned, seeing, pictures):
    photo, edited = pictures
    seeing.mode = "ORIGINAL"
    np.testing.assert_array_equal(levels(addon, learned), photo)
    addon.steps.set_swatch(learned, "pot", 1, "#00fe00")  # still the photo
    np.testing.assert_array_equal(levels(addon, learned), photo)
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    seeing.is_wiped = True
    written = addon.images.read_picture(addon.steps.save_shown(learned))
    np.testing.assert_array_equal(np.rint(written * 255), edited)
    seeing.mode, seeing.is_wiped = "EDITED", False
    np.testing.assert_array_equal(levels(addon, learned), edited)


def test_split_view_shows_the_photo_left_of_its_line(addon, learned, seeing, pictures):
    photo, edited = pictures
    seeing.is_wiped, seeing.wipe = True, 0.25
    np.testing.assert_array_equal(levels(addon, learned), np.hstack([photo[:, :6], edited[:, 6:]]))
    addon.steps.set_swatch(learned, "pot", 1, "#0000ff")  # follows
    assert (levels(addon, learned)[:, 6:] != edited[:, 6:]).any()
    np.testing.assert_array_equal(levels(addon, learned)[:, :6], photo[:, :6])


def test_solo_dims_other_objects_or_shows_a_swatchs_weights(bpy, addon, learned, seeing, pictures):
    for index, level in ((1, 64), (2, 32), (2, None)):  # weights of 1/4 and 1/8 in every pixel
        assert bpy.ops.karf.solo_swatch(object_name="pot", index=index) == {"FINISHED"}
        wanted = pictures[1] if level is None else np.full_like(pictures[1], level)
        np.testing.assert_array_equal(levels(addon, learned), wanted)
    assert seeing.mode == "EDITED"
    bpy.ops.karf.solo_swatch(object_name="pot", index=0)
    dimmed = (0.4 + 0.6 / 2) * pictures[1]  # the fake engine gives half of every pixel to each object
    assert np.abs(levels(addon, learned) - dimmed).max() <= 1
    addon.steps.set_swatch(learned, "pot", 1, "#0000ff")
    assert np.abs(levels(addon, learned) - dimmed).max() > 10
    bpy.ops.karf.solo_swatch(object_name="pot", index=0)
    assert seeing.mode == "EDITED"


def test_larger_differences_are_brighter(addon, learned, seeing):
    seeing.mode = "DIFFERENCE"
    assert np.abs(levels(addon, learned) - addon.views.heat(np.zeros(1))[0] * 255).max() <= 0.5
    addon.steps.set_swatch(learned, "pot", 1, (0.6, 0.2, 0.1))
    small = levels(addon, learned).sum()
    addon.steps.set_swatch(learned, "pot", 1, (0.0, 0.6, 0.1))
    assert small < levels(addon, learned).sum()
    first = np.zeros((601, 900, 3), np.float32)
    second = first.copy()
    second[:, 450:] = 1
    difference = addon.views.difference(first, second)
    assert difference.shape == (601, 900) and not difference[:, :450].any()
    np.testing.assert_allclose(difference[:, 452:], 100, atol=1e-3)


# the fake engine is unsure about the lid on the left and the pot on the right
MODES = {"LEARNED": ("is_rendered", (0, 0, 255), "geometry"), "UNSURE": ("is_doubted", (255, 140, 10), "segmentation")}


@pytest.mark.parametrize("mode", MODES)
def test_rendered_modes_show_the_photo_until_rendered(bpy, addon, learned, seeing, mode):
    known, color, stage = MODES[mode]
    photo, project = levels(addon, learned), addon.folders.project_of(learned)
    project.uncertainty_file.touch()
    seeing.mode = mode
    np.testing.assert_array_equal(levels(addon, learned), photo)
    assert not getattr(addon.disk.contents_of(learned), known)
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    np.testing.assert_array_equal(levels(addon, learned), np.broadcast_to(color, photo.shape))
    assert getattr(addon.disk.contents_of(learned), known)
    project.finish(stage, "anew")
    assert not getattr(addon.disk.contents_of(learned), known)


def test_masks_of_a_prepared_view_come_from_its_planes(bpy, addon, learned, seeing, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere")
    assert bpy.ops.karf.show_masks() == {"FINISHED"}
    masks = addon.displayed.of(learned).known_masks()
    assert list(masks.tints) == ["lid", "pot"]
    # both objects have half of every pixel
    expected = np.append(np.mean([addon.tints.tint_of(0), addon.tints.tint_of(1)], axis=0), 1)
    np.testing.assert_allclose(masks.fill, np.broadcast_to(expected, masks.fill.shape), atol=1e-3)
    bpy.ops.karf.show_masks()
    assert not seeing.show_masks


def test_masks_after_segmentation_overlay_the_photo(bpy, addon, project_scene, tmp_path, seeing):
    displayed = addon.displayed.of(project_scene)
    addon.steps.learn_scene(project_scene, "demo").wait()
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    addon.steps.segment(project_scene, tmp_path / "given").wait()
    assert not project_scene.karf.objects  # there is no palette yet
    assert bpy.ops.karf.show_masks() == {"FINISHED"}
    masks = displayed.known_masks()
    fill = np.repeat([[masks.tints["lid"], masks.tints["pot"]]], 16, 0).repeat(12, 1)
    np.testing.assert_allclose(masks.fill[..., :3], fill, atol=1e-6)
    photo = addon.images.read_picture(addon.captures.view_of(project_scene).image)
    np.testing.assert_array_equal(levels(addon, project_scene), np.rint(photo * 255))
    project_scene.karf.active_view = "photo_2"
    assert displayed.known_masks() is None
    bpy.ops.karf.show_masks()
    assert displayed.known_masks() is not None and seeing.show_masks
    addon.folders.project_of(project_scene).finish("segmentation", "anew")
    displayed.show_unedited()
    assert displayed.known_masks() is None


def test_outline_and_loupe_show_exact_pixels(addon):
    mask = np.zeros((4, 2), bool)
    mask[0, 1] = True  # the upper right pixel
    lines = addon.object_masks.outline(mask)[:, :2].reshape(-1, 2, 2)
    sides = {((x, 1.0), (x, 0.75)) for x in (0.5, 1.0)} | {((0.5, y), (1.0, y)) for y in (0.75, 1.0)}
    assert {tuple(map(tuple, line)) for line in lines.tolist()} == sides
    side, picture = addon.overlays.LOUPE_SIDE, np.zeros((40, 60, 3), np.uint8)
    picture[10, 20] = (255, 0, 0)
    seen = addon.overlays.pixels_at(picture, (20.5 / 60, 1 - 10.5 / 40))
    assert seen.shape == (side, side, 3)
    np.testing.assert_array_equal(np.argwhere(seen[..., 0]), [[side // 2, side // 2]])
    ramp = np.arange(40 * 60 * 3).reshape(40, 60, 3).astype(np.uint8)
    corners = addon.overlays.pixels_at(ramp, (0.0, 1.0))[[0, -1], [0, -1]] * 255
    np.testing.assert_allclose(corners, ramp[[0, side // 2], [0, side // 2]], atol=1e-4)
