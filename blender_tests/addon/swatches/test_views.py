"""What is shown of a view: its modes, the split view, masks over it, the loupe, and how far a target color is away."""

import numpy as np
import pytest


@pytest.fixture
def seeing(bpy, addon):
    """How the picture is looked at, as at the start of a session."""
    seeing = bpy.context.window_manager.karf_seeing
    for name in seeing.bl_rna.properties.keys():
        seeing.property_unset(name)
    yield seeing
    for name in seeing.bl_rna.properties.keys():
        seeing.property_unset(name)


def shown(addon, scene):
    """The result image, 8 bit."""
    return np.rint(addon.images.pixels(scene.karf.result)[..., :3] * 255).astype(int)


def test_original_is_the_photo_and_edited_comes_back(addon, learned, seeing):
    photo = shown(addon, learned)
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    edited = shown(addon, learned)
    assert (edited != photo).any()
    seeing.mode = "ORIGINAL"
    np.testing.assert_array_equal(shown(addon, learned), photo)
    addon.steps.set_swatch(learned, "pot", 1, "#00fe00")  # still the photo
    np.testing.assert_array_equal(shown(addon, learned), photo)
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    seeing.mode = "EDITED"
    np.testing.assert_array_equal(shown(addon, learned), edited)


def test_a_split_view_shows_the_photo_left_of_its_line(addon, learned, seeing):
    photo = shown(addon, learned)
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    edited = shown(addon, learned)
    seeing.is_wiped, seeing.wipe = True, 0.25
    np.testing.assert_array_equal(shown(addon, learned)[:, :6], photo[:, :6])
    np.testing.assert_array_equal(shown(addon, learned)[:, 6:], edited[:, 6:])
    addon.steps.set_swatch(learned, "pot", 1, "#0000ff")  # follows
    assert (shown(addon, learned)[:, 6:] != edited[:, 6:]).any()
    np.testing.assert_array_equal(shown(addon, learned)[:, :6], photo[:, :6])


def test_what_is_written_is_the_edited_picture_whatever_is_looked_at(addon, learned, seeing):
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    edited = shown(addon, learned)
    seeing.mode, seeing.is_wiped = "ORIGINAL", True
    written = addon.images.read_picture(addon.steps.save_shown(learned))
    np.testing.assert_array_equal(np.rint(written * 255).astype(int), edited)


def test_the_eye_of_an_object_dims_all_else_and_follows_its_swatches(bpy, addon, learned, seeing):
    edited = shown(addon, learned)
    assert bpy.ops.karf.solo_swatch(object_name="pot", index=0) == {"FINISHED"}
    # the fake engine gives half of every pixel to each object
    assert np.abs(shown(addon, learned) - (0.4 + 0.6 / 2) * edited).max() <= 1
    addon.steps.set_swatch(learned, "pot", 1, "#0000ff")
    assert np.abs(shown(addon, learned) - (0.4 + 0.6 / 2) * edited).max() > 10
    bpy.ops.karf.solo_swatch(object_name="pot", index=0)
    assert seeing.mode == "EDITED"


def test_the_eye_of_a_swatch_shows_its_weights_and_goes_out_again(bpy, addon, learned, seeing):
    photo = shown(addon, learned)
    assert bpy.ops.karf.solo_swatch(object_name="pot", index=1) == {"FINISHED"}
    # the swatch has a quarter of every pixel, the other one an eighth
    np.testing.assert_array_equal(shown(addon, learned), np.full_like(photo, 64))
    bpy.ops.karf.solo_swatch(object_name="pot", index=2)
    np.testing.assert_array_equal(shown(addon, learned), np.full_like(photo, 32))
    bpy.ops.karf.solo_swatch(object_name="pot", index=2)
    assert seeing.mode == "EDITED"
    np.testing.assert_array_equal(shown(addon, learned), photo)


def test_a_difference_is_black_where_nothing_changed_and_brighter_the_larger_it_is(addon, learned, seeing):
    seeing.mode = "DIFFERENCE"
    nothing = addon.views.heat(np.zeros(1))[0] * 255
    assert np.abs(shown(addon, learned) - nothing).max() <= 0.5
    addon.steps.set_swatch(learned, "pot", 1, (0.6, 0.2, 0.1))
    small = shown(addon, learned).sum()
    addon.steps.set_swatch(learned, "pot", 1, (0.0, 0.6, 0.1))
    assert small < shown(addon, learned).sum()


def test_large_pictures_are_compared_in_some_of_their_pixels(addon):
    first = np.zeros((601, 900, 3), np.float32)
    second = first.copy()
    second[:, 450:] = 1
    difference = addon.views.difference(first, second)
    assert difference.shape == (601, 900)
    assert not difference[:, :450].any()
    np.testing.assert_allclose(difference[:, 452:], 100, atol=1e-3)


def test_the_learned_scene_is_shown_once_it_was_rendered(bpy, addon, learned, seeing):
    photo = shown(addon, learned)
    seeing.mode = "LEARNED"
    np.testing.assert_array_equal(shown(addon, learned), photo)  # until it is there
    assert not addon.disk.contents_of(learned).is_rendered
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    np.testing.assert_array_equal(shown(addon, learned), np.broadcast_to([0, 0, 255], photo.shape))
    assert addon.disk.contents_of(learned).is_rendered
    addon.folders.project_of(learned).finish("geometry", "anew")
    assert not addon.disk.contents_of(learned).is_rendered


def test_what_is_unsure_of_any_object_is_orange_once_it_was_rendered(bpy, addon, learned, seeing):
    photo = shown(addon, learned)
    addon.folders.project_of(learned).uncertainty_file.touch()
    seeing.mode = "UNSURE"
    np.testing.assert_array_equal(shown(addon, learned), photo)
    assert not addon.disk.contents_of(learned).is_doubted
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    assert addon.disk.contents_of(learned).is_doubted
    # the fake engine is unsure of the lid on the left and of the pot on the right
    np.testing.assert_array_equal(shown(addon, learned), np.broadcast_to([255, 140, 10], photo.shape))
    addon.folders.project_of(learned).finish("segmentation", "anew")
    assert not addon.disk.contents_of(learned).is_doubted


def test_masks_of_a_prepared_view_come_from_its_planes(bpy, addon, learned, seeing, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere")
    assert bpy.ops.karf.show_masks() == {"FINISHED"}
    masks = addon.displayed.of(learned).known_masks()
    assert list(masks.tints) == ["lid", "pot"]
    # both objects have half of every pixel
    expected = np.mean([addon.tints.tint_of(0), addon.tints.tint_of(1)], axis=0)
    np.testing.assert_allclose(masks.fill[..., :3], np.broadcast_to(expected, masks.fill[..., :3].shape), atol=1e-3)
    np.testing.assert_allclose(masks.fill[..., 3], 1)
    bpy.ops.karf.show_masks()
    assert not seeing.show_masks


def test_masks_are_made_after_segment_and_shown_over_the_photo(bpy, addon, project_scene, tmp_path, seeing):
    addon.steps.learn_scene(project_scene, "demo").wait()
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    addon.steps.segment(project_scene, tmp_path / "given").wait()
    assert not project_scene.karf.objects  # there is no palette yet
    assert bpy.ops.karf.show_masks() == {"FINISHED"}
    masks = addon.displayed.of(project_scene).known_masks()
    np.testing.assert_allclose(masks.fill[:, :12, :3], np.tile(masks.tints["lid"], (16, 12, 1)), atol=1e-6)
    np.testing.assert_allclose(masks.fill[:, 12:, :3], np.tile(masks.tints["pot"], (16, 12, 1)), atol=1e-6)
    photo = addon.images.read_picture(addon.captures.view_of(project_scene).image)
    np.testing.assert_array_equal(shown(addon, project_scene), np.rint(photo * 255).astype(int))
    # another view has none yet, segmented anew neither
    project_scene.karf.active_view = "photo_2"
    assert addon.displayed.of(project_scene).known_masks() is None
    bpy.ops.karf.show_masks()
    assert addon.displayed.of(project_scene).known_masks() is not None and seeing.show_masks
    addon.folders.project_of(project_scene).finish("segmentation", "anew")
    addon.displayed.of(project_scene).show_unedited()
    assert addon.displayed.of(project_scene).known_masks() is None


def test_an_outline_goes_between_the_pixels_of_an_object_and_all_others(addon):
    mask = np.zeros((4, 2), bool)
    mask[0, 1] = True  # the upper right pixel
    lines = addon.object_masks.outline(mask)[:, :2].reshape(-1, 2, 2)
    assert {tuple(map(tuple, line)) for line in lines.tolist()} == {
        ((0.5, 1.0), (0.5, 0.75)),
        ((1.0, 1.0), (1.0, 0.75)),
        ((0.5, 1.0), (1.0, 1.0)),
        ((0.5, 0.75), (1.0, 0.75)),
    }


def test_what_is_left_to_a_target_follows_the_swatches(bpy, addon, learned):
    api, item, known = addon.engine_api, learned.karf.objects["pot"], addon.displayed.of(learned)
    assert known.left_to_target(item) is None  # there is no target color
    item.rule = "fewest"
    item.source, item.target = (0.8, 0.2, 0.1), (0.1, 0.3, 0.8)
    wanted = float(api.ciede2000(*(api.srgb_to_lab(np.array(color)) for color in (item.source, item.target))))
    assert known.left_to_target(item) == pytest.approx(wanted, abs=1e-3)
    bpy.ops.karf.becomes(object_name="pot")
    assert known.left_to_target(item) < 1
    addon.edits.reset(learned, "pot")
    assert known.left_to_target(item) == pytest.approx(wanted, abs=1e-3)
    item.target = item.source
    assert known.left_to_target(item) is None


def test_the_loupe_shows_the_pixels_round_a_place(addon):
    picture = np.zeros((40, 60, 3), np.uint8)
    picture[10, 20] = (255, 0, 0)
    seen = addon.overlays.pixels_at(picture, (20.5 / 60, 1 - 10.5 / 40))
    middle = addon.overlays.LOUPE_SIDE // 2
    assert seen.shape == (addon.overlays.LOUPE_SIDE, addon.overlays.LOUPE_SIDE, 3)
    np.testing.assert_array_equal(np.argwhere(seen[..., 0]), [[middle, middle]])


def test_beyond_the_border_the_loupe_continues_it(addon):
    picture = np.arange(40 * 60 * 3).reshape(40, 60, 3).astype(np.uint8)
    seen = addon.overlays.pixels_at(picture, (0.0, 1.0)) * 255
    np.testing.assert_allclose(seen[0, 0], picture[0, 0], atol=1e-4)
    np.testing.assert_allclose(
        seen[-1, -1], picture[addon.overlays.LOUPE_SIDE // 2, addon.overlays.LOUPE_SIDE // 2], atol=1e-4
    )
