"""Solving of swatches without Blender: functions from palette states and a gesture to colors."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
LEARNED = np.array([[0, 0, 0], [0.8, 0.1, 0.1], [0.4, 0.05, 0.05], [0.1, 0.6, 0.1]], np.float32)
BLUE, GREEN = np.float32([0.1, 0.2, 0.7]), np.float32([0.2, 0.8, 0.3])


@pytest.fixture(scope="module")
def solving():
    """The module, imported without running the extension's own `__init__`, which needs Blender."""
    for name, folder in (("karf_pure", ROOT), ("karf_pure.karf_blender", ROOT / "karf_blender")):
        sys.modules[name] = ModuleType(name)
        sys.modules[name].__path__ = [str(folder)]
    yield importlib.import_module("karf_pure.karf_blender.swatches.solving")
    for name in [name for name in sys.modules if name.partition(".")[0] == "karf_pure"]:
        del sys.modules[name]


@pytest.fixture
def seen(solving):
    """Colors of an object, each of one swatch alone."""
    weights = np.repeat(np.eye(4)[1:], 20, axis=0)
    return sys.modules["karf_pure.karf_blender.engine_api"].ColorHistogram(weights @ LEARNED, np.ones(60), weights)


@pytest.fixture
def pot(solving):
    """An object of a lit and a shaded red and of a green, as learned."""
    none, zeros = np.zeros(4, bool), np.zeros(4, np.int32)
    surface = np.tile(np.float32([1, 0, 1]), (4, 1))
    colors = LEARNED.copy(), np.zeros_like(LEARNED)
    flags = np.arange(4) == 0, zeros, zeros, none, np.ones(4, np.float32), np.zeros(4, np.float32)
    return solving.PaletteState("pot", LEARNED, *colors, *flags, surface, False)


def dragged(solving, pot, seen, index, *way):
    """The state after a swatch was dragged by these colors."""
    gesture, states = solving.Gesture((index,), pot.chosen, pot.chosen), {"pot": pot}
    for color in way:
        states = {"pot": solving.drag(solving.assign(states, "pot", index, color)["pot"], gesture, seen)}
    return states["pot"]


def test_it_needs_no_blender(solving):
    assert "bpy" not in vars(solving)


def test_a_drag_depends_on_its_start_and_its_last_color_alone(solving, pot, seen):
    direct = dragged(solving, pot, seen, 1, BLUE)
    assert direct.chosen[2, 2] > 0.25
    np.testing.assert_array_equal(dragged(solving, pot, seen, 1, GREEN, (1, 1, 0), BLUE).chosen, direct.chosen)
    np.testing.assert_array_equal(dragged(solving, pot, seen, 1, BLUE, LEARNED[1]).chosen, LEARNED)


def test_so_does_that_of_a_swatch_with_merged_ones(solving, pot, seen):
    pot = replace(pot, merged=np.array([0, 0, 1, 0]))
    direct = dragged(solving, pot, seen, 1, BLUE)
    np.testing.assert_allclose(direct.chosen[2] - LEARNED[2], np.clip(BLUE - LEARNED[1], -LEARNED[2], 2), atol=1e-6)
    np.testing.assert_array_equal(dragged(solving, pot, seen, 1, GREEN, BLUE).chosen, direct.chosen)


def test_a_gesture_goes_on_until_another_swatch_changes(solving, pot, seen):
    state = dragged(solving, pot, seen, 1, BLUE)
    gesture = solving.Gesture((1,), pot.chosen, state.chosen)
    moved = state.chosen.copy()
    moved[1] = GREEN
    assert gesture.continues((1,), moved) and not gesture.continues((3,), moved)
    moved[3] = GREEN
    assert not gesture.continues((1,), moved) and not gesture.continues((1,), moved[:3])


def test_linked_swatches_take_a_color_and_locked_ones_stay(solving, pot):
    states = {name: replace(pot, name=name, link=np.array([0, 0, 0, 1])) for name in ("pot", "lid", "box")}
    states["box"] = replace(states["box"], locked=np.array([True, False, False, True]))
    found = solving.assign(states, "pot", 3, BLUE)
    np.testing.assert_array_equal([found[name].chosen[3] for name in ("pot", "lid", "box")], [BLUE, BLUE, LEARNED[3]])
    np.testing.assert_array_equal(found["lid"].chosen[:3], LEARNED[:3])
    np.testing.assert_array_equal(states["pot"].chosen, LEARNED)  # states are values
    back, _ = solving.reset(found, "pot", 3)
    np.testing.assert_array_equal(back["lid"].chosen, LEARNED)


def test_linked_swatches_of_one_object_keep_one_color_where_their_paints_follow(solving, pot, seen):
    state = replace(pot, link=np.array([0, 1, 0, 1]))
    moved = solving.assign({"pot": state}, "pot", 1, BLUE)["pot"]
    found = solving.drag(moved, solving.Gesture((1, 3), LEARNED, LEARNED), seen).chosen
    np.testing.assert_array_equal(found[[1, 3]], [BLUE, BLUE])
    assert found[2, 2] > 0.25


def test_neutral_surfaces_add_nothing_and_locked_swatches_keep_theirs(solving, pot, seen):
    assert not solving.surface_shifts(pot, None).any()
    surface = pot.surface.copy()
    surface[1, 0] = 0
    gray = replace(pot, surface=surface)
    shown = replace(gray, shift=solving.surface_shifts(gray, seen)).edited
    assert np.ptp(shown[1]) < 0.03 and np.ptp(shown[2]) < 0.03
    locked = replace(gray, locked=np.array([True, False, True, False]))
    np.testing.assert_array_equal(solving.surface_shifts(locked, seen)[2], 0)


def test_a_color_becomes_another_and_nothing_is_left(solving, pot, seen):
    pair = solving.Becoming(LEARNED[1], BLUE, "becomes", LEARNED)
    found, missed = solving.become(pot, pair, seen)
    assert not missed
    np.testing.assert_allclose(found[1], BLUE, atol=0.02)
    assert solving.left_to_target(pot.with_colors(found), pair, seen) < 1 < solving.left_to_target(pot, pair, seen)
