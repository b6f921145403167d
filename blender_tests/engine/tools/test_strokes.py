"""The simulated artist: in which of the views that are looked at a stroke is drawn."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("torch")

from tools.marking.scene import Scene
from tools.marking.strokes import Way, candidates, draw_stroke

TRUE = np.zeros((40, 60), bool)
TRUE[10:30, 10:50] = True
LACKS = {"right": 0, "bad": 8, "worse": 16}  # columns of the object that each view's mask lacks
VIEWS = [SimpleNamespace(name=name) for name in LACKS]


@pytest.fixture
def scene():
    suggestions = SimpleNamespace(scores=dict.fromkeys(LACKS, 1.0))
    correcting = SimpleNamespace(suggestions=lambda: suggestions)
    return Scene(None, correcting, VIEWS, [], lambda view, name: TRUE)


def shown(views):
    return {view.name: {"pot": TRUE & (np.arange(60) < 50 - LACKS[view.name])} for view in views}


def drawn_in(scene, choose, look, folder):
    way = Way(choose, "line", 0, look, scene.truth)
    draw_stroke(scene, shown(candidates(scene, way, np.random.default_rng(0))), "pot", way, folder)
    return [path.stem for path in folder.glob("pot/*.png")]


def test_one_who_looks_at_one_view_draws_nothing_where_it_is_right(scene, tmp_path):
    assert drawn_in(scene, "suggested", 1, tmp_path) == []


def test_one_who_looks_on_draws_in_the_first_view_that_shows_an_error(scene, tmp_path):
    assert drawn_in(scene, "suggested", 3, tmp_path) == ["bad"]


def test_of_all_views_the_worst_is_drawn_in(scene, tmp_path):
    assert drawn_in(scene, "worst", 1, tmp_path) == ["worse"]


def test_random_views_are_as_many_as_are_looked_at(scene):
    ways = (Way("random", "line", 0, look, scene.truth) for look in (1, 4))
    one, four = (candidates(scene, way, np.random.default_rng(3)) for way in ways)
    assert len(one) == 1 and len(four) == 4 and four[:1] == one
