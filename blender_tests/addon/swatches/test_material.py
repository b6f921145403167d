"""Material editing: shades follow a dragged paint, and surfaces change its saturation, brightness and gloss."""

from unittest.mock import Mock

import numpy as np
import pytest

from karf_engine.palettes.color_histogram import write_object_colors
from karf_engine.palettes.palette import write_palettes

from .scenes import BLUE, GREEN, YELLOW, colors, palettes, set_histogram


@pytest.fixture
def pot(addon, learned):
    """A pot of a lit red, a shaded red and a green."""
    (palette,) = palettes(addon, pot=[(0.8, 0.1, 0.1), (0.4, 0.05, 0.05), (0.1, 0.6, 0.1)])
    set_histogram(addon, learned, palette.colors, np.repeat(np.eye(4)[1:], 20, axis=0))
    addon.palettes.load_palettes(learned, [palette])
    return learned.karf.objects["pot"]


@pytest.fixture
def edited(addon, pot):
    """Returns the shown palette."""
    return lambda: addon.colors.edited(pot)


def is_gray(color):
    return np.ptp(color) < 0.03


def test_shades_follow_their_paint_and_other_paints_stay(pot):
    before = colors(pot)
    pot.swatches[1].color = BLUE
    first = colors(pot)
    np.testing.assert_allclose(first[1], BLUE, atol=1e-6)
    assert first[2, 2] > 0.25 and first[2, 0] < 0.12
    np.testing.assert_allclose(first[3], before[3], atol=0.02)
    pot.swatches[3].color = YELLOW  # a second paint keeps the first
    np.testing.assert_allclose(colors(pot)[1:3], first[1:3], atol=0.02)
    np.testing.assert_allclose(colors(pot)[3], YELLOW, atol=1e-6)


@pytest.mark.parametrize("is_merged", [False, True])
def test_drag_depends_only_on_its_start_and_end(bpy, addon, learned, pot, is_merged):
    if is_merged:
        addon.steps.merge_swatch(learned, "pot", 2, 1)
    before = colors(pot)
    pot.swatches[1].color = BLUE
    direct = colors(pot)
    if is_merged:
        np.testing.assert_allclose(direct[2] - before[2], np.maximum(direct[1] - before[1], -before[2]), atol=1e-6)
    for color in (GREEN, (0.01, 0.0, 0.0), (1.0, 1.0, 0.0), BLUE):
        pot.swatches[1].color = color
    np.testing.assert_array_equal(colors(pot), direct)
    pot.swatches[1].color = pot.swatches[1].learned[:]
    np.testing.assert_array_equal(colors(pot), before)
    pot.swatches[1].color = BLUE
    bpy.ops.karf.reset_swatch(object_name="pot", index=1)
    np.testing.assert_array_equal(colors(pot), before)


def test_drag_skips_locked_swatches_and_without_material_all_others(addon, learned, pot):
    before = colors(pot)
    pot.swatches[2].locked = True
    pot.swatches[1].color = BLUE
    np.testing.assert_array_equal(colors(pot)[2], before[2])
    pot.swatches[2].locked, learned.karf.material = False, False
    pot.swatches[1].color = GREEN
    np.testing.assert_array_equal(colors(pot)[2:], before[2:])
    learned.karf.material = True
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    np.testing.assert_array_equal(colors(pot)[2:], before[2:])


def test_linked_swatch_takes_its_paint_along(addon, learned, pot):
    before = colors(pot)
    addon.steps.link_swatches(learned, ("pot", 3), ("pot", 1))
    pot.swatches[1].color = BLUE
    np.testing.assert_allclose(colors(pot)[3], BLUE, atol=1e-6)
    assert colors(pot)[2, 2] > before[2, 2] + 0.1


def test_metal_tints_highlights_with_the_paint(addon, learned, pot):
    pot.swatches[1].color = BLUE  # loading another palette ends this drag
    (gold,) = palettes(addon, pot=[(0.85, 0.65, 0.35), (1, 0.95, 0.75)])
    set_histogram(addon, learned, gold.colors, np.repeat(np.eye(3)[1:], 20, axis=0))
    addon.palettes.load_palettes(learned, [gold])
    item = learned.karf.objects["pot"]
    item.swatches[1].color = BLUE
    varnish = colors(item)
    item.is_metal = True  # after the drag as well as before it
    metal = colors(item)
    np.testing.assert_allclose(metal[1], BLUE, atol=1e-6)
    assert np.ptp(metal[2]) > np.ptp(varnish[2]) + 0.1
    item.is_metal = False
    np.testing.assert_array_equal(colors(item), varnish)


def test_keyframed_drag_moves_its_paint_after_reopening(addon, learned, pot, reopen):
    project, seen = addon.folders.project_of(learned), addon.displayed.of(learned).learned_histogram("pot")
    write_palettes(project.palette_file, addon.colors.palettes(learned), shared=False)
    write_object_colors(project.object_colors_file, {"pot": seen})
    before = colors(pot)
    for frame, color in ((1, before[1]), (11, BLUE)):
        pot.swatches[1].color = color
        pot.swatches[1].keyframe_insert("color", frame=frame)
    learned.frame_set(11)
    blue = colors(pot)
    assert np.abs(blue[2] - before[2]).max() > 0.1
    scene = reopen()
    for frame, wanted in ((1, before), (11, blue)):
        scene.frame_set(frame)
        np.testing.assert_allclose(colors(scene.karf.objects["pot"]), wanted, atol=1e-4)


def test_saturation_grays_the_paint_and_neutral_surfaces_are_exact(addon, pot, edited):
    chosen = addon.colors.chosen(pot)
    pot.swatches[1].saturation = 0
    assert is_gray(edited()[1]) and is_gray(edited()[2])
    np.testing.assert_allclose(edited()[3], chosen[3], atol=0.02)
    np.testing.assert_array_equal(addon.colors.chosen(pot), chosen)
    pot.swatches[1].color = (0.3, 0.7, 1.2)
    assert edited().tobytes() != addon.colors.chosen(pot).tobytes()
    pot.swatches[1].saturation = 1
    assert edited().tobytes() == addon.colors.chosen(pot).tobytes()


def test_surface_depends_on_its_last_value_and_follows_drags(pot, edited):
    pot.swatches[1].brightness = 0.4
    direct = edited()
    for value in (-1, 0.9, 0.0, 1.7, 0.4):
        pot.swatches[1].brightness = value
    np.testing.assert_array_equal(edited(), direct)
    pot.swatches[1].brightness = 0
    pot.swatches[1].saturation = 0
    pot.swatches[1].color = BLUE
    assert is_gray(edited()[1]) and edited()[1].sum() < 1.2


def test_splitting_a_swatch_with_a_surface_changes_no_color(bpy, pot, edited):
    pot.swatches[2].saturation = 0
    bpy.ops.karf.merge_swatch(object_name="pot", index=2, into=1)
    before = edited()
    bpy.ops.karf.split_swatch(object_name="pot", index=1)
    pot.choke = 1  # any change brings the displayed palette up to date
    np.testing.assert_array_equal(edited(), before)


def test_locked_swatch_keeps_its_shown_color(addon, pot, edited):
    chosen = addon.colors.chosen(pot)
    pot.swatches[2].locked = True
    pot.swatches[1].saturation = 0
    np.testing.assert_array_equal(edited()[2], chosen[2])
    pot.swatches[2].locked = False
    before = edited()
    assert is_gray(before[2])
    pot.swatches[2].locked = True  # locked as the other surface has moved it
    np.testing.assert_allclose(edited(), before, atol=1e-5)
    pot.swatches[1].brightness = 0.5
    assert np.abs(edited()[1] - before[1]).max() > 0.02
    pot.swatches[1].brightness, pot.swatches[1].saturation = 0, 1
    np.testing.assert_array_equal(edited()[2], before[2])
    pot.swatches[2].locked = False
    np.testing.assert_array_equal(edited(), chosen)


def test_linked_swatches_share_surfaces_but_added_colors_do_not(addon, learned, pot, edited):
    number = addon.steps.add_color(learned, "pot", (0.1, 0.6, 0.1))
    before = edited()
    addon.steps.set_surface(learned, "pot", number, saturation=0)
    np.testing.assert_array_equal(edited()[: number + 1], before[: number + 1])
    assert is_gray(edited()[number + 3])
    addon.steps.set_surface(learned, "pot", number)
    addon.steps.set_surface(learned, "pot", 3, saturation=0)
    np.testing.assert_array_equal(edited()[number:], before[number:])
    addon.steps.link_swatches(learned, ("pot", 3), ("pot", 1))
    pot.swatches[1].saturation = 0.25
    assert pot.swatches[3].saturation == 0.25
    addon.steps.set_surface(learned, "pot", 3, gloss=0.5)
    assert (pot.swatches[1].saturation, pot.swatches[1].gloss) == (1, 0.5)


def test_becomes_starts_from_shown_colors_and_clears_surfaces(addon, learned, pot, edited):
    addon.steps.set_surface(learned, "pot", 1, saturation=0)
    pot.source, pot.target = edited()[1], BLUE
    addon.edits.become_target(pot)
    np.testing.assert_allclose(edited()[1], BLUE, atol=0.02)
    assert addon.colors.state(pot).is_neutral


@pytest.mark.parametrize("operator", ["reset_surface", "reset_swatch"])
def test_reset_restores_the_learned_colors(bpy, addon, pot, edited, operator):
    pot.swatches[1].gloss, pot.swatches[1].saturation = 0.5, 0.2
    getattr(bpy.ops.karf, operator)(object_name="pot", index=1)
    assert edited().tobytes() == addon.colors.learned(pot).tobytes()


def test_missing_color_counts_keep_the_shown_colors(addon, learned, pot, edited):
    pot.swatches[1].saturation = 0
    gray = edited()
    addon.displayed.forget(learned)
    gone = addon.steps.KarfError("The project is gone.", "Choose it anew.")
    addon.displayed.of(learned).learned_histogram = Mock(side_effect=gone)
    pot.swatches[3].gloss = 0.5
    np.testing.assert_array_equal(edited(), gray)


def test_driven_socket_follows_a_surface(bpy, addon, learned, pot, edited):
    tree, group = (bpy.data.node_groups.new(name, "ShaderNodeTree") for name in ("follows", "sockets"))
    group.interface.new_socket("pot 1", in_out="INPUT", socket_type="NodeSocketColor")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    addon.nodes.drive(node, "pot", 1, learned, 'karf.objects["pot"].swatches[1]')
    material = bpy.data.materials.new("holder")
    material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = tree
    pot.swatches[1].saturation = 0
    bpy.context.view_layer.update()
    values = []
    for curve in tree.animation_data.drivers:
        names = {each.name: learned.path_resolve(each.targets[0].data_path) for each in curve.driver.variables}
        values.append(eval(curve.driver.expression, {"pow": pow}, names))
    np.testing.assert_allclose(values, addon.engine_api.srgb_to_linear(edited()[1].astype(float)), atol=1e-5)
