"""Prompts, and masks proposed for them: a ball and a striped block before a gray wall, whose masks are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from karf_engine.errors import BadRequest
from karf_engine.metrics.masks import iou
from karf_engine.segmentation.marking.prompts import Prompts
from karf_engine.segmentation.marking.proposals import Marker, propose

WIDTH, HEIGHT = 96, 72
ROWS, COLUMNS = np.mgrid[:HEIGHT, :WIDTH] + 0.5
BALL = (COLUMNS - 28) ** 2 + (ROWS - 40) ** 2 < 15**2
BLOCK = (abs(COLUMNS - 70) < 14) & (abs(ROWS - 40) < 18)
LEFT_HALF = BLOCK & (COLUMNS < 70)
ON_BALL, ON_LEFT, ON_RIGHT, ON_WALL = (28.5, 40.5, True), (62.5, 40.5, True), (78.5, 40.5, True), (48.5, 12.5, False)


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
    Prompts(box=(-20.0, -20.0, 200.0, 50.0)).check(100, 80)  # a box may reach beyond the photo


@pytest.fixture(scope="module")
def photo():
    """Float sRGB [72, 96, 3], with a little noise."""
    colors = np.full((HEIGHT, WIDTH, 3), 0.6) + 0.1 * COLUMNS[..., None] / WIDTH
    colors[BALL], colors[BLOCK], colors[LEFT_HALF] = (0.8, 0.2, 0.15), (0.9, 0.85, 0.3), (0.15, 0.25, 0.7)
    return np.clip(colors + np.random.default_rng(0).normal(0, 0.01, colors.shape), 0, 1).astype(np.float32)


AROUND_BALL = (8.0, 20.0, 48.0, 60.0)


@pytest.mark.parametrize(
    ("prompts", "expected"),
    [
        (Prompts(points=(ON_BALL,)), BALL),
        (Prompts(box=AROUND_BALL), BALL),
        (Prompts(lasso=((28.0, 18.0), (50.0, 40.0), (28.0, 64.0), (6.0, 40.0))), BALL),
        (Prompts(box=AROUND_BALL, points=(ON_BALL, ON_WALL)), BALL),
        (Prompts(points=(ON_LEFT,)), LEFT_HALF),
        (Prompts(points=(ON_LEFT, ON_RIGHT)), BLOCK),
    ],
)
def test_a_click_a_box_or_a_lasso_is_enough_for_a_plain_object_and_clicks_add_its_parts(photo, prompts, expected):
    assert iou(propose(photo, prompts), expected) > 0.95


def test_a_click_on_what_is_not_the_object_takes_it_away_and_leaves_the_rest(photo):
    mask = propose(photo, Prompts(points=(ON_BALL, ON_RIGHT, (78.5, 44.5, False))))
    assert iou(mask & ~BLOCK, BALL) > 0.95 and not mask[44, 78]


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1), st.booleans()), max_size=5))
def test_every_pixel_that_was_clicked_is_what_the_click_has_said(photo, clicks):
    said = {(x, y): is_object for x, y, is_object in clicks}
    points = tuple((x + 0.5, y + 0.5, is_object) for (x, y), is_object in said.items() if (x, y) != (28, 40))
    mask = propose(photo, Prompts(points=(ON_BALL, *points)))
    assert all(mask[int(y), int(x)] == is_object for x, y, is_object in points)


def test_a_proposal_does_not_depend_on_what_was_asked_before(photo):
    marker = Marker(photo)
    for prompts in (
        Prompts(points=(ON_LEFT, ON_RIGHT)),
        Prompts(box=AROUND_BALL),
        Prompts(points=(ON_LEFT, ON_WALL)),
        Prompts(points=(ON_LEFT,)),
    ):
        assert (marker.propose(prompts) == propose(photo, prompts)).all()


def test_a_large_photo_gets_a_mask_of_its_own_size(photo):
    large = photo.repeat(10, 0).repeat(10, 1)
    mask = propose(large, Prompts(points=((285.0, 405.0, True), (5.0, 5.0, False))))
    assert iou(mask, BALL.repeat(10, 0).repeat(10, 1)) > 0.93


def test_what_is_transparent_shows_nothing_of_the_object(photo):
    alpha = np.where(BALL, 1, 0)[..., None].astype(np.float32)
    painted = np.concatenate([np.full_like(photo, 0.8), alpha], -1)
    assert iou(propose(painted, Prompts(points=(ON_BALL,))), BALL) > 0.95


def test_a_frame_around_the_whole_photo_is_the_photo_and_clicks_beside_the_object_say_nothing(photo):
    assert propose(photo, Prompts(box=(0.0, 0.0, WIDTH, HEIGHT))).all()
    with pytest.raises(BadRequest, match="where the object is"):
        propose(photo, Prompts(points=(ON_WALL,)))
