"""Paints of an object: what a drag of one changes, and what Whole Object, edits, looks and undo do with them."""

import sys

import numpy as np
import pytest

from karf_engine.palettes.added import object_paints, paint_of

from .scenes import BLUE, GREEN, RED, YELLOW, halves, show_halves


@pytest.fixture
def pot(addon, learned, monkeypatch):
    """A pot with two paints: red on the left of the picture, yellow on the right."""
    monkeypatch.setattr(addon.palettes, "object_paints", object_paints)
    addon.palettes.load_palettes(learned, addon.colors.palettes(learned))
    show_halves(addon, learned)
    return learned.karf.objects["pot"]


def paint_like(addon, item, color):
    """The swatch of the paint of a color."""
    seen = addon.displayed.of(item.id_data).learned_histogram(item.name)
    picked = paint_of(seen, np.array(color)).picked
    return next(each for each in item.swatches if each.is_paint and np.allclose(each.learned, picked))


def assert_shows(addon, item, *wanted, atol=0.04):
    np.testing.assert_allclose(halves(addon, item.id_data), wanted, atol=atol)


def test_object_of_several_paints_offers_them_and_nothing_is_edited(addon, learned, pot):
    offered = [pot.swatches[index] for index in addon.colors.offered(pot)]
    assert pot.scope == "PAINT" and len(offered) == 2 and all(each.is_paint for each in offered)
    assert_shows(addon, pot, RED, YELLOW, atol=0.01)
    assert not addon.palettes.has_edits(learned) and not addon.edits.current_edit(learned).added
    pot.scope = "OBJECT"
    assert addon.colors.offered(pot) == [1, 2]


@pytest.mark.parametrize(("dragged", "wanted"), [(RED, (BLUE, YELLOW)), (YELLOW, (RED, BLUE))], ids=["red", "yellow"])
def test_drag_of_a_paint_leaves_the_other(addon, pot, dragged, wanted):
    paint_like(addon, pot, dragged).color = BLUE
    assert_shows(addon, pot, *wanted)


def test_learned_swatches_move_paints_that_were_given_nothing(addon, learned, pot):
    paint_like(addon, pot, YELLOW).color = BLUE
    addon.steps.set_swatch(learned, "pot", 1, GREEN)
    addon.steps.set_swatch(learned, "pot", 2, RED)
    assert_shows(addon, pot, GREEN, BLUE)
    paint_like(addon, pot, YELLOW).color = paint_like(addon, pot, YELLOW).learned
    assert_shows(addon, pot, GREEN, RED)


def test_whole_object_puts_paints_aside_and_says_what_else_moves(addon, learned, pot):
    moved = addon.displayed.of(learned).moved
    paint_like(addon, pot, RED).color = BLUE
    assert moved["pot"][1] < 1
    pot.scope = "OBJECT"
    assert_shows(addon, pot, RED, YELLOW, atol=0.01)
    pot.swatches[1].color = GREEN
    assert moved["pot"][1] > 10
    pot.scope = "PAINT"
    assert_shows(addon, pot, BLUE, YELLOW)


def test_becomes_starts_with_the_main_paint_and_changes_it_alone(bpy, addon, learned, pot):
    assert tuple(pot.source) in [tuple(each.learned) for each in pot.swatches if each.is_paint]
    pot.source, pot.target = RED, BLUE
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    assert_shows(addon, pot, BLUE, YELLOW)
    assert addon.displayed.of(learned).left_to_target(pot) < 3
    pot.source, pot.target = BLUE, GREEN  # picked in the edited picture
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    assert_shows(addon, pot, GREEN, YELLOW)


def test_edit_of_a_paint_is_the_engines_and_comes_back(addon, learned, pot, tmp_path, reopen):
    paint_like(addon, pot, RED).color = BLUE
    addon.steps.save_edit(learned, tmp_path / "edit.json")
    edit = addon.engine_api.read_edit_file(tmp_path / "edit.json", addon.colors.palettes(learned))
    assert len(edit.added["pot"]) == 1 and len(edit.colors["pot"]) == 6
    addon.edits.reset(learned, "pot")
    assert not addon.palettes.has_edits(learned)
    pot.scope = "OBJECT"
    addon.steps.apply_edit(learned, tmp_path / "edit.json")
    assert_shows(addon, pot, BLUE, YELLOW)
    paint_like(addon, pot, YELLOW).color = GREEN
    assert_shows(addon, pot, BLUE, GREEN)
    plain = addon.edits.Edit({each.name: each.colors for each in addon.colors.palettes(learned)})
    addon.steps.apply_edit(learned, plain)
    assert_shows(addon, pot, RED, YELLOW, atol=0.01)
    assert len(addon.colors.offered(pot)) == 2 and pot.scope == "PAINT"


def test_paints_follow_palettes_extracted_anew(addon, learned, pot):
    paint_like(addon, pot, RED).color = BLUE
    addon.palettes.load_palettes(learned, addon.colors.palettes(learned))
    pot = learned.karf.objects["pot"]
    show_halves(addon, learned)
    assert_shows(addon, pot, BLUE, YELLOW)
    assert len(addon.colors.offered(pot)) == 2


def test_nodes_follow_the_changed_paint(bpy, addon, learned, pot):
    numbers = addon.colors.offered(pot)
    pot.swatches[numbers[1]].color = BLUE
    last = addon.colors.states(learned)["pot"]
    learned_with_set = addon.engine_api.Palette("pot", last.learned[last.kept])
    nodes = sys.modules[addon.steps.place_points.__module__]
    assert nodes._is_ours(learned, learned_with_set)
    np.testing.assert_allclose(nodes._edited(learned, [learned_with_set])["pot"][3], BLUE, atol=1e-6)
