"""Colors added to an object: what their swatches change, and that every tool treats them as swatches."""

from pathlib import Path

import numpy as np
import pytest

from karf_engine.palettes.color_histogram import ColorHistogram, write_object_colors
from karf_engine.palettes.compositing import Planes

from ..prepared import write_current_planes

RED, YELLOW, BLUE = (0.8, 0.2, 0.1), (0.9, 0.9, 0.5), (0.1, 0.3, 0.9)


@pytest.fixture
def pots(addon, learned):
    """The scene with a pot that is red on the left and yellow on the right, and a lid that is nowhere."""
    weights = np.zeros((2, 3, 16, 24), np.float16)
    weights[1, 1, :, :12] = weights[1, 2, :, 12:] = 1
    base = np.empty((16, 24, 3), np.uint8)
    base[:, :12], base[:, 12:] = np.rint(255 * np.array(RED)), np.rint(255 * np.array(YELLOW))
    planes = Planes(("lid", "pot"), weights, weights.sum(1), base)
    write_current_planes(addon, learned, planes)
    addon.displayed.forget(learned)
    addon.displayed.of(learned).refresh()
    return learned


def shown(addon, scene):
    """The result image's two halves, sRGB [2, 3] of the pixels in their middle."""
    pixels = addon.images.pixels(scene.karf.result)[8, [6, 18], :3]
    return np.array(pixels)


def color(scene, index, name="pot"):
    return np.array(scene.karf.objects[name].swatches[index].color)


def test_an_added_color_shows_as_one_swatch_and_changes_nothing(addon, pots):
    before = addon.images.pixels(pots.karf.result).copy()
    number = addon.steps.add_color(pots, "pot", YELLOW)
    swatches = pots.karf.objects["pot"].swatches
    assert [index for index, each in enumerate(swatches) if index and not each.merged] == [1, 2, number]
    np.testing.assert_allclose(color(pots, number), YELLOW, atol=1e-6)
    np.testing.assert_array_equal(addon.images.pixels(pots.karf.result), before)
    assert [len(palette.colors) for palette in addon.colors.palettes(pots)] == [3, 3]


def test_only_its_pigment_follows_it_and_no_longer_other_swatches(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)
    addon.steps.set_swatch(pots, "pot", 2, (0, 0, 0))
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)
    addon.steps.set_swatch(pots, "pot", 1, (0, 1, 0))
    np.testing.assert_allclose(shown(addon, pots), [(0, 1, 0), BLUE], atol=0.02)
    addon.steps.remove_color(pots, "pot", number)
    np.testing.assert_allclose(shown(addon, pots), [(0, 1, 0), (0, 0, 0)], atol=0.01)
    assert len(pots.karf.objects["pot"].swatches) == 3


def test_it_begins_as_the_edited_picture_shows_it(addon, pots):
    addon.steps.set_swatch(pots, "pot", 2, BLUE)
    number = addon.steps.add_color(pots, "pot", YELLOW)
    np.testing.assert_allclose(color(pots, number), BLUE, atol=1e-6)
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)
    addon.edits.reset(pots, "pot", number)
    np.testing.assert_allclose(shown(addon, pots), [RED, YELLOW], atol=0.01)


def test_adding_it_changes_no_bit_of_an_edited_picture(addon, pots):
    for index, wanted in ((1, (0.2, 0.7, 0.4)), (2, (0.6, 0.1, 0.5))):
        addon.steps.set_swatch(pots, "pot", index, wanted)
    before = addon.images.pixels(pots.karf.result).copy()
    addon.steps.add_color(pots, "pot", YELLOW)
    np.testing.assert_array_equal(addon.images.pixels(pots.karf.result), before)


def test_the_color_at_a_place_is_that_of_the_object_as_learned(addon, pots):
    addon.steps.set_swatch(pots, "pot", 1, BLUE)
    np.testing.assert_allclose(addon.steps.color_at(pots, "pot", (0.2, 0.5)), RED, atol=1e-3)
    np.testing.assert_allclose(addon.steps.color_at(pots, "pot", (0.8, 0.5)), YELLOW, atol=1e-3)
    for name, place in (("lid", (0.2, 0.5)), ("pot", (-1, -1)), ("pot", (0.5, 1.2))):
        with pytest.raises(addon.engine_api.BadRequest, match="is not at this place"):
            addon.steps.color_at(pots, name, place)


def test_the_operators_add_and_remove_with_undo(bpy, addon, pots):
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.karf.add_color(object_name="pot", picked=YELLOW) == {"FINISHED"}
    addon.steps.set_swatch(bpy.context.scene, "pot", 3, BLUE)
    bpy.ops.ed.undo_push(message="added")
    bpy.ops.karf.remove_color(object_name="pot", index=3)
    bpy.ops.ed.undo_push(message="removed")
    np.testing.assert_allclose(shown(addon, bpy.context.scene), [RED, YELLOW], atol=0.01)
    bpy.ops.ed.undo()
    np.testing.assert_allclose(shown(addon, bpy.context.scene), [RED, BLUE], atol=0.02)
    bpy.ops.ed.undo()
    np.testing.assert_allclose(shown(addon, bpy.context.scene), [RED, YELLOW], atol=0.01)
    assert len(bpy.context.scene.karf.objects["pot"].swatches) == 3


def test_keyframes_and_links_move_its_pigment(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW)
    swatch = pots.karf.objects["pot"].swatches[number]
    swatch.keyframe_insert("color", frame=1)
    swatch.color = BLUE
    swatch.keyframe_insert("color", frame=11)
    for frame, right in ((1, YELLOW), (11, BLUE)):
        pots.frame_set(frame)
        np.testing.assert_allclose(shown(addon, pots), [RED, right], atol=0.02)
    pots.animation_data_clear()
    addon.steps.link_swatches(pots, ("pot", number), ("lid", 1))
    addon.steps.set_swatch(pots, "lid", 1, (0.3, 0.6, 0.2))
    np.testing.assert_allclose(shown(addon, pots), [RED, (0.3, 0.6, 0.2)], atol=0.02)


def test_reach_is_how_far_its_hue_goes(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    pots.karf.objects["pot"].swatches[number].reach = 3.0
    left, _ = shown(addon, pots)
    assert np.abs(left - RED).max() > 0.1
    pots.karf.objects["pot"].swatches[number].reach = 0.5
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)


def test_its_weights_are_shown_alone(bpy, addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW)
    bpy.ops.karf.solo_swatch(object_name="pot", index=number)
    np.testing.assert_allclose(shown(addon, pots)[:, 0], [0, 1], atol=0.01)
    bpy.context.window_manager.karf_seeing.mode = "EDITED"


def test_an_edit_file_keeps_it(addon, pots, tmp_path):
    addon.steps.add_color(pots, "pot", YELLOW, BLUE, reach=0.75)
    addon.steps.save_edit(pots, tmp_path / "edit.json")
    addon.steps.remove_color(pots, "pot", 3)
    addon.steps.apply_edit(pots, tmp_path / "edit.json")
    assert pots.karf.objects["pot"].swatches[3].reach == 0.75
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)
    pots.karf.objects["pot"].swatches[3].locked = True
    addon.steps.apply_edit(pots, tmp_path / "edit.json")
    addon.steps.save_edit(pots, tmp_path / "same.json")
    assert (tmp_path / "same.json").read_text() == (tmp_path / "edit.json").read_text()
    with pytest.raises(addon.engine_api.BadRequest, match="cannot hold the colors that were added to pot"):
        addon.steps.save_edit(pots, tmp_path / "pots.gpl")


def test_a_locked_one_stays_where_another_edit_is_loaded(addon, pots, tmp_path):
    addon.steps.save_edit(pots, tmp_path / "edit.json")
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    pots.karf.objects["pot"].swatches[3].locked = True
    for tool in (
        lambda: addon.steps.apply_edit(pots, tmp_path / "edit.json"),
        lambda: addon.steps.remove_color(pots, "pot", 3),
    ):
        with pytest.raises(addon.engine_api.BadRequest, match="locked"):
            tool()
    np.testing.assert_allclose(shown(addon, pots), [RED, BLUE], atol=0.02)


def test_becomes_leaves_it(addon, pots):
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    addon.steps.becomes(pots, "pot", RED, (0.2, 0.7, 0.3))
    np.testing.assert_allclose(shown(addon, pots), [(0.2, 0.7, 0.3), BLUE], atol=0.03)


def test_a_match_leaves_it_and_sees_it(addon, pots):
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    image = addon.steps.paint_over(pots)
    pixels = addon.images.pixels(image)
    pixels[:, :12, :3] = (0.2, 0.7, 0.3)
    addon.images.upload(image, pixels)
    (found,) = addon.steps.match_picture(pots)
    assert found.after < 0.5
    np.testing.assert_allclose(shown(addon, pots), [(0.2, 0.7, 0.3), BLUE], atol=0.03)


def test_a_learned_swatch_is_merged_and_not_removed_and_an_added_one_removed_and_not_merged(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW)
    with pytest.raises(addon.engine_api.BadRequest, match="is a learned color"):
        addon.steps.remove_color(pots, "pot", 1)
    with pytest.raises(addon.engine_api.BadRequest, match="is an added color"):
        addon.steps.merge_swatch(pots, "pot", number)
    with pytest.raises(addon.engine_api.BadRequest, match="cannot be merged"):
        addon.steps.merge_swatch(pots, "pot", 1, number)
    assert addon.steps.merge_swatch(pots, "pot", 1) == 2


def test_removing_one_leaves_the_others_and_their_keyframes(addon, pots):
    first = addon.steps.add_color(pots, "pot", YELLOW)
    second = addon.steps.add_color(pots, "pot", RED)
    for swatch in (pots.karf.objects["pot"].swatches[number] for number in (first, second)):
        swatch.keyframe_insert("color", frame=1)
    kept = addon.engine_api.rgb_to_hex(pots.karf.objects["pot"].swatches[first].learned)
    addon.steps.remove_color(pots, "pot", first)
    assert [each.merged for each in pots.karf.objects["pot"].swatches[3:]] == [0, 3, 3]
    paths = {curve.data_path for curve in addon.compat.curves_of(pots.animation_data)}
    assert paths == {"karf.objects[1].swatches[3].color", f'karf.objects["pot"].swatches["{kept}"].color'}
    addon.steps.set_swatch(pots, "pot", 3, BLUE)
    np.testing.assert_allclose(shown(addon, pots), [BLUE, YELLOW], atol=0.02)


def test_what_has_no_pigment_is_refused(addon, pots):
    with pytest.raises(addon.engine_api.BadRequest, match="black"):
        addon.steps.add_color(pots, "pot", (0, 0, 0))
    assert len(pots.karf.objects["pot"].swatches) == 3


def test_it_stays_when_palettes_are_found_anew(addon, pots):
    number = addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    pots.karf.objects["pot"].swatches[number].keyframe_insert("color", frame=1)
    make, known = addon.engine_api.Palette, addon.colors.palettes(pots)
    four = np.array([(0, 0, 0), (0.1, 0.8, 0.1), RED, YELLOW], np.float32)
    seen = {"pot": ColorHistogram(four[1:], np.ones(3), np.eye(4)[1:])}
    write_object_colors(addon.folders.project_of(pots).object_colors_file, seen)
    addon.palettes.load_palettes(pots, [make("pot", four), known[0]])
    swatches = pots.karf.objects["pot"].swatches
    assert [index for index, each in enumerate(swatches) if index and not each.merged] == [1, 2, 3, 4]
    np.testing.assert_allclose(color(pots, 4), BLUE, atol=1e-6)
    (curve, *_) = addon.compat.curves_of(pots.animation_data)
    assert curve.data_path == "karf.objects[0].swatches[4].color"
    hidden = np.array([each.color for each in swatches[5:]])
    np.testing.assert_allclose(hidden[2], BLUE, atol=0.02)


def test_the_compositors_layers_have_it(addon, pots):
    (request,) = addon.steps.build_compositor(pots).requests
    assert request.options["edit"] is None
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    (request,) = addon.steps.build_compositor(pots).requests
    palettes = addon.colors.palettes(pots)
    edit = addon.engine_api.read_edit_file(Path(request.options["edit"]), palettes)
    assert len(edit.added["pot"]) == 1 and len(edit.colors["pot"]) == 6


def test_the_scene_in_3d_has_it(addon, pots):
    api, n = addon.engine_api, 2
    none, weights = np.zeros((n, 3), np.float32), np.zeros((n, 2, 3), np.float16)
    weights[0, 1, 1] = weights[1, 1, 2] = 1
    learned = np.stack([palette.colors for palette in addon.colors.palettes(pots)])
    colors = np.rint(255 * np.array([RED, YELLOW])).astype(np.uint8)
    points = api.ScenePoints(
        ("lid", "pot"), none, none + [0, 0, 1], none[:, 0] + 1, colors, weights.sum(2), weights, learned
    )
    file = addon.folders.project_of(pots).points_file
    api.write_points(file, points)
    addon.steps.add_color(pots, "pot", YELLOW, BLUE)
    item = addon.steps.place_points(pots, file)
    import bpy

    data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(16 * n, np.float32)
    data.attributes["Color"].data.foreach_get("color_srgb", flat)
    np.testing.assert_allclose(flat.reshape(n, 4, 4)[:, 0, :3], [RED, BLUE], atol=0.02)
    addon.steps.set_swatch(pots, "pot", 3, (0.1, 0.6, 0.2))
    data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    data.attributes["Color"].data.foreach_get("color_srgb", flat)
    np.testing.assert_allclose(flat.reshape(n, 4, 4)[:, 0, :3], [RED, (0.1, 0.6, 0.2)], atol=0.02)
