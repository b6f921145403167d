"""Saturation, brightness and gloss of a swatch."""

import numpy as np
import pytest


@pytest.fixture
def edited(addon, pot):
    """The palette that is shown."""
    return lambda: addon.colors.edited(pot)


def is_gray(color):
    return np.ptp(color) < 0.03


def test_neutral_numbers_show_the_chosen_colors_very_bits(addon, pot, edited):
    pot.swatches[1].color = (0.3, 0.7, 1.2)
    assert edited().tobytes() == addon.colors.chosen(pot).tobytes()
    pot.swatches[1].saturation = 0
    assert edited().tobytes() != addon.colors.chosen(pot).tobytes()
    pot.swatches[1].saturation = 1
    assert edited().tobytes() == addon.colors.chosen(pot).tobytes()


def test_the_paint_of_a_swatch_turns_gray_and_other_paints_stay(addon, pot, edited):
    chosen = addon.colors.chosen(pot)
    pot.swatches[1].saturation = 0
    assert is_gray(edited()[1]) and is_gray(edited()[2])
    np.testing.assert_allclose(edited()[3], chosen[3], atol=0.02)
    np.testing.assert_array_equal(addon.colors.chosen(pot), chosen)


def test_a_number_that_is_moved_to_and_fro_ends_where_it_would_at_once(pot, edited):
    pot.swatches[1].brightness = 0.4
    direct = edited()
    for value in (-1, 0.9, 0.0, 1.7, 0.4):
        pot.swatches[1].brightness = value
    np.testing.assert_array_equal(edited(), direct)


def test_splitting_a_swatch_that_had_a_surface_changes_no_color(bpy, pot, edited):
    pot.swatches[2].saturation = 0
    bpy.ops.karf.merge_swatch(object_name="pot", index=2, into=1)
    before = edited()
    bpy.ops.karf.split_swatch(object_name="pot", index=1)
    pot.choke = 1  # any change brings the displayed palette up to date
    np.testing.assert_array_equal(edited(), before)


def test_a_color_that_is_dragged_takes_its_surface_along(pot, edited):
    pot.swatches[1].saturation = 0
    pot.swatches[1].color = (0.1, 0.2, 0.8)
    assert is_gray(edited()[1]) and edited()[1].sum() < 1


def test_locked_swatches_stay(addon, pot, edited):
    pot.swatches[2].locked = True
    pot.swatches[1].saturation = 0
    np.testing.assert_array_equal(edited()[2], addon.colors.chosen(pot)[2])
    pot.swatches[2].locked = False
    assert is_gray(edited()[2])


def test_locking_a_swatch_that_the_surface_of_another_has_moved_changes_no_picture(addon, pot, edited):
    pot.swatches[1].saturation = 0
    before = edited()
    pot.swatches[2].locked = True
    np.testing.assert_allclose(edited(), before, atol=1e-5)
    pot.swatches[1].brightness = 0.5
    assert np.abs(edited()[1] - before[1]).max() > 0.02
    pot.swatches[1].brightness, pot.swatches[1].saturation = 0, 1
    np.testing.assert_array_equal(edited()[2], before[2])
    np.testing.assert_array_equal(edited()[1], addon.colors.chosen(pot)[1])
    pot.swatches[2].locked = False
    np.testing.assert_array_equal(edited(), addon.colors.chosen(pot))


def test_linked_swatches_share_their_surface(addon, learned, pot, edited):
    addon.steps.link_swatches(learned, ("pot", 3), ("pot", 1))
    pot.swatches[1].saturation = 0.25
    assert pot.swatches[3].saturation == 0.25
    addon.steps.set_surface(learned, "pot", 3, gloss=0.5)
    assert (pot.swatches[1].saturation, pot.swatches[1].gloss) == (1, 0.5)


def test_an_added_color_has_a_surface_of_its_own(addon, learned, pot, edited):
    number = addon.steps.add_color(learned, "pot", (0.1, 0.6, 0.1))
    before = edited()
    addon.steps.set_surface(learned, "pot", number, saturation=0)
    np.testing.assert_array_equal(edited()[: number + 1], before[: number + 1])
    assert is_gray(edited()[number + 3])
    addon.steps.set_surface(learned, "pot", number)
    addon.steps.set_surface(learned, "pot", 3, saturation=0)
    np.testing.assert_array_equal(edited()[number:], before[number:])


def test_keyframes_move_it(learned, pot, edited):
    swatch = pot.swatches[1]
    swatch.keyframe_insert("saturation", frame=1)
    learned.frame_set(11)
    swatch.saturation = 0
    swatch.keyframe_insert("saturation", frame=11)
    gray, middle = edited(), []
    learned.frame_set(1)
    np.testing.assert_array_equal(edited()[1], np.float32([0.8, 0.1, 0.1]))
    learned.frame_set(6)
    middle = np.ptp(edited()[1])
    assert 0.1 < middle < 0.65
    learned.frame_set(11)
    np.testing.assert_allclose(edited(), gray, atol=1e-6)


def test_undo_takes_it_back(bpy, addon, learned, pot):
    bpy.ops.ed.undo_push(message="before")
    pot.swatches[1].saturation = 0
    bpy.ops.ed.undo_push(message="gray")
    bpy.ops.ed.undo()
    item = bpy.context.scene.karf.objects["pot"]
    assert item.swatches[1].saturation == 1
    assert addon.colors.edited(item).tobytes() == addon.colors.learned(item).tobytes()


def test_an_edit_file_has_the_colors_that_are_shown(addon, learned, pot, edited, tmp_path):
    addon.steps.set_surface(learned, "pot", 1, saturation=0)
    before = edited()
    addon.steps.save_edit(learned, tmp_path / "gray.json")
    addon.steps.apply_edit(learned, tmp_path / "gray.json")
    np.testing.assert_array_equal(edited(), before)
    np.testing.assert_array_equal(addon.colors.chosen(pot), before)
    assert addon.colors.state(pot).is_neutral


def test_becomes_begins_from_what_is_shown(addon, learned, pot, edited):
    addon.steps.set_surface(learned, "pot", 1, saturation=0)
    gray = edited()[1]
    pot.source = gray
    pot.target = (0.1, 0.2, 0.5)
    addon.edits.become_target(pot)
    np.testing.assert_allclose(edited()[1], (0.1, 0.2, 0.5), atol=0.02)
    assert addon.colors.state(pot).is_neutral


def test_reset_gives_the_learned_look_back(bpy, addon, pot, edited):
    pot.swatches[1].gloss, pot.swatches[1].saturation = 0.5, 0.2
    bpy.ops.karf.reset_surface(object_name="pot", index=1)
    assert edited().tobytes() == addon.colors.learned(pot).tobytes()
    pot.swatches[1].saturation = 0.2
    bpy.ops.karf.reset_swatch(object_name="pot")
    assert edited().tobytes() == addon.colors.learned(pot).tobytes()


def test_new_palettes_keep_it(addon, learned, pot):
    pot.swatches[1].saturation = 0.25
    palette = np.array([[0, 0, 0], [0.1, 0.6, 0.1], [0.79, 0.1, 0.1]], np.float32)
    seen = addon.engine_api.ColorHistogram(palette, np.ones(3), np.eye(3))
    addon.displayed.of(learned).learned_histogram = lambda name: seen
    addon.palettes.load_palettes(learned, [addon.engine_api.Palette("pot", palette)])
    assert [swatch.saturation for swatch in learned.karf.objects["pot"].swatches] == [1, 1, 0.25]


def test_without_counted_colors_what_was_shown_stays(addon, learned, pot, edited):
    pot.swatches[1].saturation = 0
    gray = edited()
    addon.displayed.forget(learned)

    def lost(name):
        raise addon.steps.KarfError("The project is gone.", "Choose it anew.")

    addon.displayed.of(learned).learned_histogram = lost
    pot.swatches[3].gloss = 0.5
    np.testing.assert_array_equal(edited(), gray)


def test_a_driven_socket_follows(bpy, addon, learned, pot, edited):
    tree = bpy.data.node_groups.new("follows", "ShaderNodeTree")
    group = bpy.data.node_groups.new("sockets", "ShaderNodeTree")
    group.interface.new_socket("pot 1", in_out="INPUT", socket_type="NodeSocketColor")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    addon.nodes.drive(node, "pot", 1, learned, 'karf.objects["pot"].swatches[1]')
    material = bpy.data.materials.new("holder")
    material.use_nodes = True
    holder = material.node_tree.nodes.new("ShaderNodeGroup")
    holder.node_tree = tree
    pot.swatches[1].saturation = 0
    bpy.context.view_layer.update()
    expected = addon.engine_api.srgb_to_linear(edited()[1].astype(float))
    curves = tree.animation_data.drivers
    values = [_value(curve, learned) for curve in curves]
    np.testing.assert_allclose(values, expected, atol=1e-5)


def _value(curve, scene):
    """What the driver's expression gives, worked out here."""
    names = {each.name: scene.path_resolve(each.targets[0].data_path) for each in curve.driver.variables}
    return eval(curve.driver.expression, {"pow": pow}, names)


def test_a_value_out_of_range_and_a_locked_swatch_are_refused(bpy, addon, pot):
    with pytest.raises(addon.steps.KarfError, match="gloss"):
        addon.steps.set_surface(bpy.context.scene, "pot", 1, gloss=-1.0)
    pot.swatches[1].locked = True
    with pytest.raises(addon.steps.KarfError, match="locked"):
        addon.steps.set_surface(bpy.context.scene, "pot", 1, gloss=0.0)
