"""Making one color become another, and matching swatches to a painted view or picture."""

import numpy as np
import pytest

from .scenes import BLUE, GREEN, LID, RED, color, pixels


@pytest.fixture
def item(learned):
    return learned.karf.objects["pot"]


def test_live_target_recolors_from_the_main_color(item):
    np.testing.assert_allclose(item.source, RED, atol=0.01)
    assert item.source[:] == item.target[:]
    item.source, item.target = RED, BLUE
    assert item.swatches[1].color[:] == item.swatches[1].learned[:]
    item.live = True
    blue = item.swatches[1].color[:]
    np.testing.assert_allclose(blue, BLUE, atol=0.01)
    for target, wanted, tolerance in ((GREEN, GREEN, 0.02), (BLUE, blue, 1e-5)):
        item.target = target
        np.testing.assert_allclose(item.swatches[1].color, wanted, atol=tolerance)


def test_unreachable_source_or_target_is_reported(bpy, addon, item, capfd):
    item.source, item.target = (0.0, 1.0, 0.0), BLUE
    with pytest.raises(RuntimeError, match="pot shows no color like #00ff00"):
        bpy.ops.karf.becomes(object_name="pot")
    item.live = True
    np.testing.assert_array_equal(addon.colors.edited(item), addon.colors.learned(item))
    item.live = False
    item.swatches[1].locked = True
    item.source = RED
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    assert "not quite what was wanted, because" in capfd.readouterr().out


def test_earlier_drags_do_not_hide_the_source_color(bpy, addon, learned, item):
    item.target = BLUE
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    expected = addon.colors.edited(item)
    addon.steps.set_swatch(learned, "pot", 1, (0.2, 0.9, 0.3))  # now the picture has no red
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    np.testing.assert_allclose(addon.colors.edited(item), expected, atol=1e-6)


def test_remaining_difference_follows_swatches_and_pair(bpy, addon, learned, item):
    api, left_to_target = addon.engine_api, addon.displayed.of(learned).left_to_target
    assert left_to_target(item) is None  # no target color yet
    item.source, item.target = RED, BLUE
    red, blue = (api.srgb_to_lab(np.array(each)) for each in (item.source, item.target))
    begun = pytest.approx(left_to_target(item))
    assert 5 < left_to_target(item) < api.ciede2000(red, blue)
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    assert left_to_target(item) < 1
    addon.steps.set_swatch(learned, "pot", 2, (0.1, 0.9, 0.2))  # a swatch outside the pair
    assert left_to_target(item) > 3
    addon.edits.reset(learned, "pot")
    assert left_to_target(item) == begun
    item.target = item.source
    assert left_to_target(item) is None


@pytest.fixture
def painted(addon, learned):
    """The picture of an edit that was reset again."""
    addon.steps.set_swatch(learned, "lid", 1, (0.5, 0.2, 0.3))
    picture = pixels(addon, learned)
    addon.edits.reset(learned, "lid")
    return picture


def test_picture_files_of_any_size_are_matched(addon, learned, painted, tmp_path):
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


def test_painting_over_a_view_matches_that_view_only(bpy, addon, learned, painted):
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


def test_matching_keeps_locked_swatches(addon, learned, painted, tmp_path):
    addon.images.write_png(tmp_path / "wanted.png", painted)
    learned.karf.objects["lid"].swatches[1].locked = True
    addon.steps.match_picture(learned, tmp_path / "wanted.png")
    np.testing.assert_allclose(color(learned, "lid", 1), LID[0], atol=1e-6)
    assert np.abs(color(learned, "lid", 2) - 1).max() > 0.1
