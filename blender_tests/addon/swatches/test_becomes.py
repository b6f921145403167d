"""One color that becomes another, also from an edited picture, and swatches fitted to a painted view."""

import numpy as np
import pytest

from .scenes import BLUE, GREEN, LID, RED, color, pixels


@pytest.fixture
def item(learned):
    return learned.karf.objects["pot"]


@pytest.fixture
def press(bpy, item):
    """Choose a source and a target, and press Becomes."""

    def press(source=None, target=None):
        if source:
            item.source, item.target = source, target
        assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}

    return press


def assert_shows(item, *colors, atol):
    """The swatches have these colors; None is any."""
    for swatch, wanted in zip(item.swatches[1:], colors, strict=True):
        if wanted is not None:
            np.testing.assert_allclose(swatch.color, wanted, atol=atol)


def test_a_live_target_moves_the_swatches_from_the_main_color(item):
    np.testing.assert_allclose(item.source, RED, atol=0.01)
    assert item.source[:] == item.target[:]
    item.source, item.target = RED, BLUE
    assert item.swatches[1].color[:] == item.swatches[1].learned[:]
    item.live = True
    blue = item.swatches[1].color[:]
    np.testing.assert_allclose(blue, BLUE, atol=0.01)
    item.target = GREEN
    assert_shows(item, GREEN, None, atol=0.02)
    item.target = BLUE
    assert_shows(item, blue, None, atol=1e-5)


def test_an_impossible_source_or_target_is_reported(addon, item, press, capfd):
    item.source, item.target = (0.0, 1.0, 0.0), BLUE
    with pytest.raises(RuntimeError, match="pot shows no color like #00ff00"):
        press()
    item.live = True
    np.testing.assert_array_equal(addon.colors.edited(item), addon.colors.learned(item))
    item.live = False
    item.swatches[1].locked = True
    press(RED, BLUE)
    assert "not quite what was wanted, because" in capfd.readouterr().out


def test_what_was_dragged_before_does_not_hide_the_color_that_it_begins_with(addon, learned, item, press):
    item.target = BLUE
    press()
    expected = addon.colors.edited(item)
    addon.steps.set_swatch(learned, "pot", 1, (0.2, 0.9, 0.3))  # the picture has no red any more
    press()
    np.testing.assert_allclose(addon.colors.edited(item), expected, atol=1e-6)


def test_what_is_left_follows_swatches_pair_and_rule(addon, learned, item, press):
    api, known = addon.engine_api, addon.displayed.of(learned)
    assert known.left_to_target(item) is None  # there is no target color
    item.source, item.target = RED, BLUE
    red, blue = (api.srgb_to_lab(np.array(each)) for each in (item.source, item.target))
    item.rule = "fewest"
    assert known.left_to_target(item) == pytest.approx(float(api.ciede2000(red, blue)), abs=1e-3)
    item.rule = "becomes"
    press()
    assert known.left_to_target(item) < 1
    addon.steps.set_swatch(learned, "pot", 2, (0.1, 0.9, 0.2))  # of the pot, but not of the pair
    assert known.left_to_target(item) > 3
    item.rule = "fewest"
    assert known.left_to_target(item) < 1
    addon.edits.reset(learned, "pot")
    assert known.left_to_target(item) == pytest.approx(float(api.ciede2000(red, blue)), abs=1e-3)
    item.target = item.source
    assert known.left_to_target(item) is None


# --- a painted view --------------------------------------------------------------------------------------------------
@pytest.fixture
def painted(addon, learned):
    """The picture of an edit that is undone again."""
    addon.steps.set_swatch(learned, "lid", 1, (0.5, 0.2, 0.3))
    picture = pixels(addon, learned)
    addon.edits.reset(learned, "lid")
    return picture


def test_a_picture_file_of_any_size_is_matched_and_what_is_left_is_told(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "wanted.png", painted)
    addon.images.write_png(tmp_path / "large.png", painted.repeat(3, axis=0).repeat(3, axis=1))
    for name, share in (("wanted", 0.2), ("large", 0.3)):
        addon.edits.reset(learned, "lid")
        (found,) = addon.steps.match_picture(learned, tmp_path / f"{name}.png")
        assert found.name == "lid" and found.after < share * found.before
        assert np.abs(pixels(addon, learned) - painted).mean() < 0.01
    (left,) = learned.karf.match.left
    assert (left.name, left.left) == ("lid", pytest.approx(found.after))
    addon.images.write_png(tmp_path / "wide.png", painted[:8])
    with pytest.raises(addon.engine_api.BadRequest, match=r"'wide\.png' has 24 x 8 pixels, but the view has 24 x 16"):
        addon.steps.match_picture(learned, tmp_path / "wide.png")


def test_what_is_painted_over_the_view_is_matched_to_it_alone(bpy, addon, learned, painted):
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
    addon.steps.show_view(learned, "photo_2").wait()
    with pytest.raises(RuntimeError, match="was painted over the view 'photo_0'"):
        bpy.ops.karf.match_picture()
    learned.karf.active_view, learned.karf.compositing = "photo_0", "paper"
    with pytest.raises(RuntimeError, match="Photo plus change"):
        bpy.ops.karf.match_picture()


def test_a_match_leaves_locked_swatches(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "wanted.png", painted)
    learned.karf.objects["lid"].swatches[1].locked = True
    addon.steps.match_picture(learned, tmp_path / "wanted.png")
    np.testing.assert_allclose(color(learned, "lid", 1), LID[0], atol=1e-6)
    assert np.abs(color(learned, "lid", 2) - 1).max() > 0.1
