"""Swatches fitted to a painted view, and "one color becomes another" that goes on from an edited picture."""

import numpy as np
import pytest

RED, BLUE = (0.8, 0.2, 0.1), (0.1, 0.3, 0.8)


def color(scene, name, index):
    return np.array(scene.karf.objects[name].swatches[index].color)


def pixels(addon, scene):
    return addon.images.pixels(scene.karf.result)[..., :3]


@pytest.fixture
def painted(addon, learned):
    """The picture of an edit that is undone again."""
    addon.steps.set_swatch(learned, "lid", 1, (0.5, 0.2, 0.3))
    picture = pixels(addon, learned).copy()
    addon.edits.reset(learned, "lid")
    return picture


def test_a_picture_file_is_matched_and_what_is_left_is_told(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "wanted.png", painted)
    (found,) = addon.steps.match_picture(learned, tmp_path / "wanted.png")
    assert found.name == "lid" and found.after < 0.2 * found.before
    assert np.abs(pixels(addon, learned) - painted).mean() < 0.01
    (left,) = learned.karf.match.left
    assert (left.name, left.left) == ("lid", pytest.approx(found.after))


def test_what_is_painted_over_the_view_is_matched(bpy, addon, learned, painted):
    assert bpy.ops.karf.paint_over() == {"FINISHED"}
    image = learned.karf.match.picture
    np.testing.assert_array_equal(addon.images.pixels(image)[..., :3], pixels(addon, learned))
    with pytest.raises(RuntimeError, match="unchanged"):
        bpy.ops.karf.match_picture()
    buffer = addon.images.blank(*image.size)
    addon.images.upright(buffer)[:] = painted
    addon.images.upload(image, buffer)
    assert bpy.ops.karf.match_picture() == {"FINISHED"}
    assert np.abs(pixels(addon, learned) - painted).mean() < 0.01


def test_a_painting_is_matched_to_its_own_view_only(bpy, addon, learned):
    bpy.ops.karf.paint_over()
    addon.steps.show_view(learned, "photo_2").wait()
    with pytest.raises(RuntimeError, match="was painted over the view 'photo_0'"):
        bpy.ops.karf.match_picture()


def test_a_picture_may_have_any_size_but_no_other_shape(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "large.png", painted.repeat(3, axis=0).repeat(3, axis=1))
    (found,) = addon.steps.match_picture(learned, tmp_path / "large.png")
    assert found.after < 0.3 * found.before
    addon.images.write_png(tmp_path / "wide.png", painted[:8])
    with pytest.raises(addon.engine_api.BadRequest, match=r"'wide\.png' has 24 x 8 pixels, but the view has 24 x 16"):
        addon.steps.match_picture(learned, tmp_path / "wide.png")


def test_a_match_leaves_locked_swatches(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "wanted.png", painted)
    learned.karf.objects["lid"].swatches[1].locked = True
    addon.steps.match_picture(learned, tmp_path / "wanted.png")
    np.testing.assert_allclose(color(learned, "lid", 1), (0.2, 0.4, 0.6), atol=1e-6)
    assert np.abs(color(learned, "lid", 2) - 1).max() > 0.1


def test_a_palette_picture_is_not_matched(bpy, addon, learned):
    learned.karf.compositing = "paper"
    with pytest.raises(RuntimeError, match="Photo plus change"):
        bpy.ops.karf.paint_over()
        bpy.ops.karf.match_picture()


def test_a_live_target_moves_the_swatches_at_once_and_from_where_it_began(addon, learned):
    item = learned.karf.objects["pot"]
    item.source, item.target = RED, BLUE
    assert item.swatches[1].color[:] == item.swatches[1].learned[:]
    item.live = True
    blue = color(learned, "pot", 1)
    np.testing.assert_allclose(blue, BLUE, atol=0.01)
    item.target = (0.2, 0.8, 0.3)
    assert color(learned, "pot", 1)[1] > 0.7
    item.target = BLUE
    np.testing.assert_allclose(color(learned, "pot", 1), blue, atol=1e-5)


def test_a_color_of_the_edited_picture_becomes_another(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    addon.steps.becomes(learned, "pot", RED, BLUE)
    other = color(learned, "pot", 2)
    item.source, item.target = BLUE, (0.2, 0.8, 0.3)
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    np.testing.assert_allclose(color(learned, "pot", 1), (0.2, 0.8, 0.3), atol=0.02)
    addon.edits.reset(learned, "pot")
    addon.steps.becomes(learned, "pot", RED, BLUE)
    addon.steps.becomes(learned, "pot", BLUE, (0.2, 0.8, 0.3), from_edited=True)
    np.testing.assert_allclose(color(learned, "pot", 1), (0.2, 0.8, 0.3), atol=0.02)
    assert np.abs(color(learned, "pot", 2) - other).max() < 0.2


def test_it_goes_on_from_what_was_changed_since_the_color_was_picked(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    item.source, item.target = RED, BLUE
    addon.steps.set_swatch(learned, "pot", 2, (0.3, 0.9, 0.9))
    item.rule = "fewest"
    bpy.ops.karf.becomes(object_name="pot")
    np.testing.assert_allclose(color(learned, "pot", 2), (0.3, 0.9, 0.9), atol=1e-6)


def test_paint_after_paint_what_a_paint_became_is_kept(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    yellow, orange = tuple(item.swatches[2].learned), (0.9, 0.6, 0.1)
    item.source, item.target = RED, orange
    bpy.ops.karf.becomes(object_name="pot")
    item.source, item.target = yellow, BLUE
    bpy.ops.karf.becomes(object_name="pot")
    np.testing.assert_allclose(color(learned, "pot", 1), orange, atol=0.06)
    np.testing.assert_allclose(color(learned, "pot", 2), BLUE, atol=0.06)
    item.source, item.target = orange, (0.2, 0.8, 0.3)  # what was held is another's paint no more
    bpy.ops.karf.becomes(object_name="pot")
    np.testing.assert_allclose(color(learned, "pot", 1), (0.2, 0.8, 0.3), atol=0.06)
    np.testing.assert_allclose(color(learned, "pot", 2), BLUE, atol=0.06)


def test_a_color_that_the_object_does_not_show_is_refused_and_changes_nothing(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    item.source, item.target = (0.0, 1.0, 0.0), BLUE
    with pytest.raises(RuntimeError, match="pot shows no color like #00ff00"):
        bpy.ops.karf.becomes(object_name="pot")
    item.live = True
    np.testing.assert_array_equal(addon.colors.edited(item), addon.colors.learned(item))


def test_a_picture_with_paint_brighter_than_white_becomes_another(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    addon.steps.set_swatch(learned, "pot", 2, (1.3, 1.2, 0.7))
    item.source, item.target = RED, BLUE
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    np.testing.assert_allclose(color(learned, "pot", 1), BLUE, atol=0.05)


def test_what_was_dragged_before_does_not_hide_the_color_that_it_begins_with(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    item.target = BLUE
    bpy.ops.karf.becomes(object_name="pot")
    expected = addon.colors.edited(item)
    addon.steps.set_swatch(learned, "pot", 1, (0.2, 0.9, 0.3))  # the picture has no red any more
    bpy.ops.karf.becomes(object_name="pot")
    np.testing.assert_allclose(addon.colors.edited(item), expected, atol=1e-6)


def test_it_begins_with_the_color_that_the_object_mostly_has(addon, learned):
    item = learned.karf.objects["pot"]
    np.testing.assert_allclose(item.source, RED, atol=0.01)
    assert item.source[:] == item.target[:]


def test_what_is_left_is_of_the_whole_object_and_not_of_the_pair(bpy, addon, learned):
    item, known = learned.karf.objects["pot"], addon.displayed.of(learned)
    item.source, item.target = RED, BLUE
    bpy.ops.karf.becomes(object_name="pot")
    assert known.left_to_target(item) < 1
    addon.steps.set_swatch(
        learned, "pot", 2, (0.1, 0.9, 0.2)
    )  # the pair is met as before, but not what else the pot shows
    assert known.left_to_target(item) > 3
    item.rule = "fewest"
    assert known.left_to_target(item) < 1


def test_a_target_that_is_missed_is_told_with_the_reason(addon, learned):
    item = learned.karf.objects["pot"]
    item.source, item.target = RED, BLUE
    item.swatches[1].locked = True
    assert "not quite what was wanted, because" in addon.edits.become_target(item)
