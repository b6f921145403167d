"""Drawn scenes of thin parts: the same every time, two marked things of two forms, nothing in anything else."""

import math

import pytest

from tools.procedural.seeded.draw import THIN_FORMS, radius_of
from tools.procedural.seeded.thin_draw import PLACES, SOLID, draw_thin_scene

SEEDS = range(900, 940)  # neither those for work nor those for reports


@pytest.fixture(scope="module")
def scenes():
    return [draw_thin_scene(seed) for seed in SEEDS]


def test_a_seed_draws_the_same_scene_every_time_and_another_attempt_another():
    assert draw_thin_scene(900) == draw_thin_scene(900) != draw_thin_scene(900, attempt=1)


def test_places_take_turns_and_every_form_with_a_thin_part_comes_up(scenes):
    assert [scene.place for scene in scenes[:3]] == [PLACES[seed % 3] for seed in SEEDS[:3]]
    assert {thing.form for scene in scenes for thing in scene.marked} == set(THIN_FORMS)


def test_two_things_with_thin_parts_are_marked_and_no_other_thing_has_any(scenes):
    for scene in scenes:
        assert [thing.object_id for thing in scene.things] == [1, 2, 0, 0, 0]
        assert scene.things[0].form != scene.things[1].form
        assert {thing.form for thing in scene.things[2:]} <= set(SOLID)


def test_nothing_stands_in_anything_else_and_a_neighbor_of_its_hue_touches_the_first(scenes):
    for scene in scenes:
        for number, thing in enumerate(scene.things):
            for other in scene.things[:number]:
                apart = math.dist(thing.position, other.position)
                assert apart >= radius_of(thing) + radius_of(other) - 1e-9
        first, neighbor = scene.things[0], scene.things[2]
        assert math.dist(first.position, neighbor.position) == pytest.approx(radius_of(first) + radius_of(neighbor))


def test_the_edit_repaints_both_marked_things_which_have_one_color_each(scenes):
    for scene in scenes:
        assert set(scene.repaints) == {"all"} and set(scene.repaints["all"]) == {thing.name for thing in scene.marked}
        for thing in scene.marked:
            assert len(thing.paint.colors) == 1 and scene.repaints["all"][thing.name] != thing.paint.colors
