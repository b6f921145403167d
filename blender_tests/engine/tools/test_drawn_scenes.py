"""Random scenes drawn from a seed are reproducible, varied, and without intersecting objects."""

import math

import pytest

from tools.scenes.seeded.draw import FORMS, draw_scene, radius_of
from tools.scenes.seeded.scene import PLACES, RELATIONS

SEEDS = range(300, 380)  # used neither in development nor in reports
SCENES = [draw_scene(seed) for seed in SEEDS]
every_scene = pytest.mark.parametrize("scene", SCENES, ids=map(str, SEEDS))


def test_seed_and_attempt_determine_the_scene():
    another = draw_scene(300, attempt=1)
    assert draw_scene(300) == SCENES[0] != another
    assert SCENES[0].place == another.place


def test_places_alternate_and_all_else_varies():
    assert [scene.place for scene in SCENES[:8]] == [PLACES[seed % 4] for seed in SEEDS[:8]]
    assert {scene.relation for scene in SCENES} == set(RELATIONS)
    assert {thing.form for scene in SCENES for thing in scene.marked} == set(FORMS) - {"cage"}
    assert {len(scene.marked) for scene in SCENES} == {1, 2, 3}
    assert {scene.cameras.way for scene in SCENES} == {"dome", "patch", "path"}
    assert all(3 <= len(scene.things) <= 12 for scene in SCENES)


def gap(thing, other):
    return math.dist(thing.position, other.position) - radius_of(thing) - radius_of(other)


@every_scene
def test_objects_are_numbered_and_intersect_only_a_cage(scene):
    count = len(scene.marked)
    assert [thing.object_id for thing in scene.things] == [*range(1, count + 1), *[0] * (len(scene.things) - count)]
    assert len({thing.name for thing in scene.things}) == len(scene.things)
    for number, thing in enumerate(scene.things):
        for other in scene.things[:number]:
            is_caged = thing.position == other.position and "cage" in (thing.form, other.form)
            assert is_caged or gap(thing, other) >= -1e-9


@every_scene
def test_stated_relation_is_present(scene):
    first, *others = scene.things
    touching = [other for other in others if abs(gap(other, first)) < 1e-6]
    twins = [other for other in others if (other.form, other.proportions) == (first.form, first.proportions)]
    found = {
        "twin": [other for other in twins if other.paint == first.paint],
        "part": [other for other in touching if other.paint == first.paint],
        "touching": touching,
        "behind leaves": [other for other in touching if other.form == "plant"],
        "behind wires": [other for other in others if other.form == "cage" and other.position == first.position],
        "same hue": touching,
        "none": [first],
    }
    assert found[scene.relation]


@every_scene
def test_edits_repaint_the_first_or_all_marked_objects(scene):
    paints = {thing.name: thing.paint.colors for thing in scene.marked}
    first = scene.marked[0].name
    assert set(scene.repaints["first"]) == {first} and set(scene.repaints["all"]) == set(paints)
    assert scene.repaints["first"][first][1:] == paints[first][1:]
    for edit in scene.repaints.values():
        for name, colors in edit.items():
            assert len(colors) == len(paints[name]) and colors[0] != paints[name][0]
            assert all(0 <= channel <= 0.8 for color in colors for channel in color)
