"""Swatches that are locked, linked, merged, swapped and pasted: what each tool changes, and what it must not."""

import numpy as np
import pytest

BLUE, GREEN = (0.1, 0.2, 0.8), (0.2, 0.7, 0.3)


def swatch(scene, name, index):
    return scene.karf.objects[name].swatches[index]


def color(scene, name, index):
    return np.array(swatch(scene, name, index).color)


def pixels(addon, scene):
    return np.rint(addon.images.pixels(scene.karf.result)[..., :3] * 255).astype(int)


def test_no_tool_changes_a_locked_swatch(bpy, addon, learned, tmp_path):
    karf, refused = addon.steps, addon.engine_api.BadRequest
    karf.save_edit(learned, tmp_path / "learned.json")
    karf.set_swatch(learned, "pot", 1, BLUE)
    swatch(learned, "pot", 1).locked = True
    bpy.ops.karf.reset_swatch(object_name="pot")
    addon.edits.paste(learned, "pot", None, "#00ff00 #00ff00")
    karf.apply_edit(learned, tmp_path / "learned.json")
    karf.link_swatches(learned, ("lid", 1), ("pot", 1))
    karf.set_swatch(learned, "lid", 1, GREEN)
    for tool in (
        lambda: karf.set_swatch(learned, "pot", 1, GREEN),
        lambda: addon.edits.reset(learned, "pot", 1),
        lambda: addon.edits.swap(learned, ("pot", 2), ("pot", 1)),
        lambda: addon.edits.paste(learned, "pot", 1, "#00ff00"),
        lambda: karf.link_swatches(learned, ("pot", 1), ("lid", 2)),
        lambda: karf.merge_swatch(learned, "pot", 1, 2),
    ):
        with pytest.raises(refused, match="locked"):
            tool()
    np.testing.assert_allclose(color(learned, "pot", 1), BLUE, atol=1e-6)
    np.testing.assert_allclose(color(learned, "lid", 1), GREEN, atol=1e-6)


def test_linked_swatches_of_two_objects_have_one_color(addon, learned):
    karf = addon.steps
    karf.set_swatch(learned, "lid", 2, BLUE)
    karf.link_swatches(learned, ("pot", 1), ("lid", 2))
    np.testing.assert_allclose(color(learned, "pot", 1), BLUE, atol=1e-6)
    karf.link_swatches(learned, ("lid", 1), ("pot", 1))
    swatch(learned, "pot", 1).color = GREEN  # as a drag in the picker does
    for name, index in (("pot", 1), ("lid", 1), ("lid", 2)):
        np.testing.assert_allclose(color(learned, name, index), GREEN, atol=1e-6)
    assert np.abs(color(learned, "pot", 2) - (0.9, 0.9, 0.5)).max() < 1e-6
    addon.edits.reset(learned, "pot", 1)
    assert all(each.color[:] == each.learned[:] for item in learned.karf.objects for each in item.swatches)


def test_an_unlinked_swatch_moves_by_itself(addon, learned):
    karf = addon.steps
    karf.link_swatches(learned, ("pot", 1), ("lid", 1))
    addon.steps.unlink_swatch(learned, "pot", 1)
    karf.set_swatch(learned, "pot", 1, GREEN)
    assert swatch(learned, "lid", 1).color[:] == swatch(learned, "lid", 1).learned[:]
    assert not swatch(learned, "lid", 1).link


def test_the_picture_shows_what_linked_swatches_do(addon, learned):
    addon.steps.link_swatches(learned, ("pot", 1), ("lid", 1))
    addon.steps.set_swatch(learned, "pot", 1, GREEN)
    linked = pixels(addon, learned)
    addon.steps.unlink_swatch(learned, "pot", 1)
    addon.edits.reset(learned, "pot")
    addon.edits.reset(learned, "lid")
    addon.steps.set_swatch(learned, "pot", 1, GREEN)
    addon.steps.set_swatch(learned, "lid", 1, GREEN)
    np.testing.assert_array_equal(pixels(addon, learned), linked)


def test_merging_changes_no_picture_and_then_both_change_alike(addon, learned):
    before = pixels(addon, learned)
    assert addon.steps.merge_swatch(learned, "pot", 2) == 1
    np.testing.assert_array_equal(pixels(addon, learned), before)
    addon.steps.set_swatch(learned, "pot", 1, (0.7, 0.3, 0.4))
    np.testing.assert_allclose(color(learned, "pot", 2), (0.8, 1.0, 0.8), atol=1e-6)
    with pytest.raises(addon.engine_api.BadRequest, match="merged into 1"):
        addon.steps.set_swatch(learned, "pot", 2, BLUE)
    addon.steps.split_swatch(learned, "pot", 1)
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    np.testing.assert_allclose(color(learned, "pot", 2), (0.8, 1.0, 0.8), atol=1e-6)


def test_the_last_shown_swatch_cannot_be_removed(addon, learned):
    addon.steps.merge_swatch(learned, "pot", 2)
    with pytest.raises(addon.engine_api.BadRequest, match="cannot be merged"):
        addon.steps.merge_swatch(learned, "pot", 1)


def test_becomes_moves_merged_swatches_as_one(addon, learned):
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    addon.steps.becomes(learned, "pot", (0.8, 0.2, 0.1), (0.5, 0.4, 0.3))
    moved = color(learned, "pot", 1) - (0.8, 0.2, 0.1)
    np.testing.assert_allclose(color(learned, "pot", 2) - (0.9, 0.9, 0.5), moved, atol=1e-6)
    assert np.abs(moved).max() > 0.1


def test_keyframes_of_one_swatch_move_its_group(bpy, addon, learned):
    addon.steps.link_swatches(learned, ("lid", 1), ("pot", 1))
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    one = swatch(learned, "pot", 1)
    one.keyframe_insert("color", frame=1)
    one.color = (0.6, 0.3, 0.2)
    one.keyframe_insert("color", frame=11)
    learned.frame_set(1)
    np.testing.assert_allclose(color(learned, "lid", 1), (0.8, 0.2, 0.1), atol=1e-6)
    learned.frame_set(11)
    np.testing.assert_allclose(color(learned, "lid", 1), (0.6, 0.3, 0.2), atol=1e-6)
    np.testing.assert_allclose(color(learned, "pot", 2), (0.7, 1.0, 0.6), atol=1e-6)


def test_swapping_exchanges_two_colors(bpy, addon, learned):
    assert bpy.ops.karf.swap_swatches(object_name="pot", index=1, other_name="lid", other_index=2) == {"FINISHED"}
    np.testing.assert_allclose(color(learned, "pot", 1), (1, 1, 1), atol=1e-6)
    np.testing.assert_allclose(color(learned, "lid", 2), (0.8, 0.2, 0.1), atol=1e-6)


def test_colors_travel_as_text_and_brighter_ones_too(bpy, addon, learned):
    assert addon.edits.copied(learned, "pot", 1) == "#cc331a"
    addon.steps.set_swatch(learned, "pot", 2, (1.5, 0.25, 0.0))
    addon.edits.paste(learned, "lid", None, addon.edits.copied(learned, "pot", None))
    np.testing.assert_allclose(color(learned, "lid", 2), (1.5, 0.25, 0.0), atol=1e-6)
    np.testing.assert_allclose(color(learned, "lid", 1) * 255, (204, 51, 26), atol=1e-3)
    with pytest.raises(addon.engine_api.BadRequest, match="no color"):
        addon.edits.paste(learned, "lid", None, "no color at all")


def test_a_preset_holds_a_palette_for_any_object(bpy, addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    learned.karf.objects["lid"].palette = learned.karf.objects["pot"].palette
    np.testing.assert_allclose(color(learned, "lid", 1), BLUE, atol=0.5 / 255 + 1e-6)
    kept = addon.engine_api.colors_of_text(learned.karf.objects["pot"].palette)
    np.testing.assert_allclose(kept, [BLUE, color(learned, "pot", 2)], atol=0.5 / 255 + 1e-6)


def test_each_tool_is_one_step_of_undo(bpy, addon, learned):
    def state():
        return [
            (each.color[:], each.link, each.merged) for item in bpy.context.scene.karf.objects for each in item.swatches
        ]

    tools = (
        lambda: bpy.ops.karf.swap_swatches(object_name="pot", index=1, other_name="lid", other_index=2),
        lambda: bpy.ops.karf.link_swatches(object_name="pot", index=1, other_name="lid", other_index=2),
        lambda: bpy.ops.karf.merge_swatch(object_name="pot", index=2),
        lambda: bpy.ops.karf.reset_swatch(object_name="pot"),
    )
    for tool in tools:
        bpy.ops.ed.undo_push(message="before")
        before = state()
        assert tool() == {"FINISHED"}
        after = state()
        bpy.ops.ed.undo_push(message="tool")
        bpy.ops.ed.undo()
        assert state() == before
        bpy.ops.ed.redo()
        assert state() == after != before


def test_links_and_merges_stay_where_palettes_are_extracted_anew(addon, learned):
    addon.steps.link_swatches(learned, ("lid", 1), ("pot", 1))
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    addon.palettes.load_palettes(learned, addon.colors.palettes(learned))
    assert swatch(learned, "pot", 2).merged == 1
    assert swatch(learned, "lid", 1).link == swatch(learned, "pot", 1).link > 0
