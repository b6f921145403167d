"""Dragging one swatch moves its paint."""

import numpy as np

from karf_engine.palettes.color_histogram import write_object_colors
from karf_engine.palettes.palette import write_palettes

BLUE = (0.1, 0.2, 0.7)


def colors(item):
    return np.array([swatch.color[:] for swatch in item.swatches])


def test_shades_of_the_paint_follow_and_other_paints_stay(pot):
    before = colors(pot)
    pot.swatches[1].color = BLUE
    after = colors(pot)
    np.testing.assert_allclose(after[1], BLUE, atol=1e-6)
    assert after[2, 2] > 0.25 and after[2, 0] < 0.12
    np.testing.assert_allclose(after[3], before[3], atol=0.02)


def test_a_drag_ends_where_its_last_color_alone_would(pot):
    pot.swatches[1].color = BLUE
    direct = colors(pot)
    for color in ((0.3, 0.9, 0.2), (0.01, 0.0, 0.0), (1.0, 1.0, 0.0), BLUE):
        pot.swatches[1].color = color
    np.testing.assert_array_equal(colors(pot), direct)


def test_dragged_back_or_reset_everything_is_as_it_was(bpy, pot):
    before = colors(pot)
    pot.swatches[1].color = BLUE
    pot.swatches[1].color = pot.swatches[1].learned[:]
    np.testing.assert_array_equal(colors(pot), before)
    pot.swatches[1].color = BLUE
    bpy.ops.karf.reset_swatch(object_name="pot", index=1)
    np.testing.assert_array_equal(colors(pot), before)


def test_a_second_paint_goes_on_from_the_first(pot):
    pot.swatches[1].color = BLUE
    first = colors(pot)
    pot.swatches[3].color = (0.9, 0.8, 0.1)
    np.testing.assert_allclose(colors(pot)[1:3], first[1:3], atol=0.02)
    np.testing.assert_allclose(colors(pot)[3], (0.9, 0.8, 0.1), atol=1e-6)


def test_locked_swatches_stay_and_without_material_all_others_do(learned, pot):
    before = colors(pot)
    pot.swatches[2].locked = True
    pot.swatches[1].color = BLUE
    np.testing.assert_array_equal(colors(pot)[2], before[2])
    pot.swatches[2].locked, learned.karf.material = False, False
    pot.swatches[1].color = (0.1, 0.7, 0.7)
    np.testing.assert_array_equal(colors(pot)[2:], before[2:])


def test_what_a_program_sets_stands_alone(bpy, addon, pot):
    before = colors(pot)
    addon.steps.set_swatch(bpy.context.scene, "pot", 1, BLUE)
    np.testing.assert_array_equal(colors(pot)[2:], before[2:])


def test_a_linked_swatch_takes_its_own_paint_along(bpy, addon, pot):
    before = colors(pot)
    addon.steps.link_swatches(bpy.context.scene, ("pot", 3), ("pot", 1))
    pot.swatches[1].color = BLUE
    after = colors(pot)
    np.testing.assert_allclose(after[3], BLUE, atol=1e-6)
    assert after[2, 2] > before[2, 2] + 0.1


def test_keyframes_of_a_dragged_swatch_move_its_paint(learned, pot):
    before, swatch = colors(pot), pot.swatches[1]
    swatch.keyframe_insert("color", frame=1)
    learned.frame_set(20)
    swatch.color = BLUE
    swatch.keyframe_insert("color", frame=20)
    blue = colors(pot)
    learned.frame_set(1)
    np.testing.assert_allclose(colors(pot), before, atol=1e-6)
    learned.frame_set(20)
    np.testing.assert_allclose(colors(pot), blue, atol=1e-6)


def test_metal_says_that_highlights_take_the_paints_color(addon, learned, pot):
    gold = np.array([[0, 0, 0], [0.85, 0.65, 0.35], [1, 0.95, 0.75]], np.float32)
    addon.palettes.load_palettes(learned, [addon.engine_api.Palette("pot", gold)])
    weights = np.repeat(np.eye(3)[1:], 20, axis=0)
    seen = addon.engine_api.ColorHistogram(weights @ gold, np.ones(40), weights)
    addon.displayed.of(learned).learned_histogram = lambda name: seen
    item = learned.karf.objects["pot"]
    item.swatches[1].color = BLUE
    varnish = colors(item)
    item.is_metal = True  # after the drag as well as before it
    metal = colors(item)
    np.testing.assert_allclose(metal[1], BLUE, atol=1e-6)
    assert np.ptp(metal[2]) > np.ptp(varnish[2]) + 0.1
    item.is_metal = False
    np.testing.assert_array_equal(colors(item), varnish)


def test_a_drag_goes_on_in_a_file_that_is_opened_again(bpy, addon, learned, pot, tmp_path):
    project, seen = addon.folders.project_of(learned), addon.displayed.of(learned).learned_histogram("pot")
    write_palettes(project.palette_file, addon.colors.palettes(learned), shared=False)
    write_object_colors(project.object_colors_file, {"pot": seen})
    item = pot
    for frame, color in ((1, item.swatches[1].learned[:]), (11, BLUE)):
        item.swatches[1].color = color
        item.swatches[1].keyframe_insert("color", frame=frame)
    learned.frame_set(11)
    blue = colors(item)
    assert np.abs(blue[2] - item.swatches[2].learned[:]).max() > 1e-3
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    scene = bpy.context.scene
    scene.frame_set(1)
    item = scene.karf.objects["pot"]
    np.testing.assert_allclose(colors(item), [swatch.learned[:] for swatch in item.swatches], atol=1e-4)
    scene.frame_set(11)
    np.testing.assert_allclose(colors(item), blue, atol=1e-4)
