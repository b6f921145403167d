"""Scenes that a seed draws: the same every time, each unlike the others, with nothing standing in anything else."""

import math

import pytest

from tools.scenes.seeded.draw import FORMS, draw_scene, radius_of
from tools.scenes.seeded.scene import PLACES, RELATIONS

SEEDS = range(300, 380)  # neither those for work nor those for reports


@pytest.fixture(scope="module")
def scenes():
    return [draw_scene(seed) for seed in SEEDS]


def test_a_seed_draws_the_same_scene_every_time_and_another_attempt_another():
    assert draw_scene(300) == draw_scene(300)
    assert draw_scene(300) != draw_scene(300, attempt=1)
    assert draw_scene(300).place == draw_scene(300, attempt=1).place


def test_places_take_turns_and_all_else_varies(scenes):
    assert [scene.place for scene in scenes[:8]] == [PLACES[seed % 4] for seed in SEEDS[:8]]
    assert {scene.relation for scene in scenes} == set(RELATIONS)
    assert {thing.form for scene in scenes for thing in scene.marked} == set(FORMS) - {"cage"}
    assert {len(scene.marked) for scene in scenes} == {1, 2, 3}
    assert {scene.cameras.way for scene in scenes} == {"dome", "patch", "path"}
    assert all(3 <= len(scene.things) <= 12 for scene in scenes)


def test_marked_things_come_first_and_are_numbered_from_one(scenes):
    for scene in scenes:
        numbers = [thing.object_id for thing in scene.things]
        count = len(scene.marked)
        assert numbers == [*range(1, count + 1), *[0] * (len(numbers) - count)]
        assert len({thing.name for thing in scene.things}) == len(scene.things)


def test_nothing_stands_in_anything_else_but_in_a_cage(scenes):
    for scene in scenes:
        for number, thing in enumerate(scene.things):
            for other in scene.things[:number]:
                same_spot = thing.position == other.position and "cage" in (thing.form, other.form)
                apart = math.dist(thing.position, other.position)
                assert same_spot or apart >= radius_of(thing) + radius_of(other) - 1e-9


def test_each_relation_is_there_where_it_is_said_to_be(scenes):
    for scene in scenes:
        first, others = scene.things[0], scene.things[1:]
        found = {
            "twin": [
                o for o in others if (o.form, o.proportions, o.paint) == (first.form, first.proportions, first.paint)
            ],
            "part": [o for o in others if o.paint == first.paint and _touches(o, first)],
            "touching": [o for o in others if _touches(o, first)],
            "behind leaves": [o for o in others if o.form == "plant" and _touches(o, first)],
            "behind wires": [o for o in others if o.form == "cage" and o.position == first.position],
            "same hue": [o for o in others if _touches(o, first)],
            "none": [first],
        }
        assert found[scene.relation], scene


def _touches(thing, other):
    return abs(math.dist(thing.position, other.position) - radius_of(thing) - radius_of(other)) < 1e-6


def test_one_edit_changes_the_first_thing_s_main_color_and_the_other_every_color_of_marked_things(scenes):
    for scene in scenes:
        paints = {thing.name: thing.paint.colors for thing in scene.marked}
        first = scene.marked[0].name
        assert set(scene.repaints["first"]) == {first} and set(scene.repaints["all"]) == set(paints)
        assert scene.repaints["first"][first][1:] == paints[first][1:]
        for edit in scene.repaints.values():
            for name, colors in edit.items():
                assert len(colors) == len(paints[name]) and colors[0] != paints[name][0]
                assert all(0 <= channel <= 0.8 for color in colors for channel in color)
