"""Prompts: what Blender and the command line say, and what cannot be meant."""

import pytest

pytest.importorskip("numpy")

from karf_engine.errors import BadRequest
from karf_engine.segmentation.marking.prompts import Prompts


def test_prompts_survive_json():
    prompts = Prompts(
        (1.0, 2.0, 30.0, 40.0), ((4.5, 5.5, True), (6.5, 7.5, False)), ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))
    )
    assert Prompts.from_json(prompts.to_json()) == prompts
    assert Prompts.from_json({"box": None, "points": [], "lasso": None}) == Prompts()


@pytest.mark.parametrize(
    "content",
    [
        [],
        {"box": [1, 2, 3]},
        {"box": "wide"},
        {"box": [0, 0, float("nan"), 5]},
        {"points": [[1, 2]]},
        {"points": [5]},
        {"lasso": [[1, 2, 3]]},
    ],
)
def test_what_is_no_prompts_is_refused(content):
    with pytest.raises(BadRequest, match="not a box, clicks or a lasso"):
        Prompts.from_json(content)


@pytest.mark.parametrize(
    "prompts",
    [
        Prompts(),
        Prompts(points=((5.5, 5.5, False),)),
        Prompts(points=((100.0, 5.5, True),)),
        Prompts(points=((5.5, -0.5, True),)),
        Prompts(box=(120.0, 0.0, 140.0, 50.0)),
        Prompts(box=(50.0, 0.0, 40.0, 50.0)),
        Prompts(lasso=((1.0, 1.0), (9.0, 9.0))),
        Prompts(lasso=((-9.0, 1.0), (-1.0, 1.0), (-1.0, 9.0))),
    ],
)
def test_prompts_that_mean_nothing_in_a_photo_are_refused_with_a_remedy(prompts):
    with pytest.raises(BadRequest) as refused:
        prompts.check(100, 80)
    assert refused.value.sentence.endswith(".") and refused.value.hint


def test_a_box_may_reach_beyond_the_photo():
    Prompts(box=(-20.0, -20.0, 200.0, 50.0)).check(100, 80)
