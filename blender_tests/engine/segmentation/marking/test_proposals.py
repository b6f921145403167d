"""Masks proposed for prompts, on a ball and a two-colored block before a gray wall."""

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
AROUND_BALL = (8.0, 20.0, 48.0, 60.0)


def test_prompts_round_trip_through_json():
    clicks, lasso = ((4.5, 5.5, True), (6.5, 7.5, False)), ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))
    prompts = Prompts((1.0, 2.0, 30.0, 40.0), clicks, lasso)
    assert Prompts.from_json(prompts.to_json()) == prompts
    assert Prompts.from_json({"box": None, "points": [], "lasso": None}) == Prompts()


@pytest.mark.parametrize(
    "content",
    [
        *([], {"points": [[1, 2]]}, {"points": [5]}, {"lasso": [[1, 2, 3]]}),
        *({"box": box} for box in ([1, 2, 3], "wide", [0, 0, float("nan"), 5])),
    ],
)
def test_malformed_prompts_are_rejected(content):
    with pytest.raises(BadRequest, match="not a box, clicks or a lasso"):
        Prompts.from_json(content)


@pytest.mark.parametrize(
    "prompts",
    [
        Prompts(),
        *(Prompts(points=(click,)) for click in ((5.5, 5.5, False), (100.0, 5.5, True), (5.5, -0.5, True))),
        *(Prompts(box=box) for box in ((120.0, 0.0, 140.0, 50.0), (50.0, 0.0, 40.0, 50.0))),
        *(Prompts(lasso=lasso) for lasso in (((1.0, 1.0), (9.0, 9.0)), ((-9.0, 1.0), (-1.0, 1.0), (-1.0, 9.0)))),
    ],
)
def test_prompts_without_meaning_in_a_photo_are_rejected(prompts):
    with pytest.raises(BadRequest) as caught:
        prompts.check(100, 80)
    assert caught.value.sentence.endswith(".") and caught.value.hint
    Prompts(box=(-20.0, -20.0, 200.0, 50.0)).check(100, 80)  # a box may reach beyond the photo


@pytest.fixture(scope="module")
def photo():
    """The photo with a little noise, float sRGB [72, 96, 3]."""
    colors = np.full((HEIGHT, WIDTH, 3), 0.6) + 0.1 * COLUMNS[..., None] / WIDTH
    colors[BALL], colors[BLOCK], colors[LEFT_HALF] = (0.8, 0.2, 0.15), (0.9, 0.85, 0.3), (0.15, 0.25, 0.7)
    return np.clip(colors + np.random.default_rng(0).normal(0, 0.01, colors.shape), 0, 1).astype(np.float32)


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
def test_one_prompt_marks_a_plain_object_and_clicks_add_parts(photo, prompts, expected):
    assert iou(propose(photo, prompts), expected) > 0.95


def test_negative_click_removes_only_its_part(photo):
    mask = propose(photo, Prompts(points=(ON_BALL, ON_RIGHT, (78.5, 44.5, False))))
    assert iou(mask & ~BLOCK, BALL) > 0.95 and not mask[44, 78]


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1), st.booleans()), max_size=5))
def test_every_clicked_pixel_is_as_clicked(photo, clicks):
    last = {(x, y): is_object for x, y, is_object in clicks}
    points = tuple((x + 0.5, y + 0.5, is_object) for (x, y), is_object in last.items() if (x, y) != (28, 40))
    mask = propose(photo, Prompts(points=(ON_BALL, *points)))
    assert all(mask[int(y), int(x)] == is_object for x, y, is_object in points)


def test_proposals_do_not_depend_on_earlier_prompts(photo):
    marker, block = Marker(photo), Prompts(points=(ON_LEFT, ON_RIGHT))
    halves = [Prompts(points=points) for points in ((ON_LEFT, ON_WALL), (ON_LEFT,))]
    for prompts in (block, Prompts(box=AROUND_BALL), *halves):
        assert (marker.propose(prompts) == propose(photo, prompts)).all()


def test_large_photo_gets_a_mask_of_its_size(photo):
    large = photo.repeat(10, 0).repeat(10, 1)
    mask = propose(large, Prompts(points=((285.0, 405.0, True), (5.0, 5.0, False))))
    assert iou(mask, BALL.repeat(10, 0).repeat(10, 1)) > 0.93


def test_transparent_pixels_are_not_the_object(photo):
    alpha = np.where(BALL, 1, 0)[..., None].astype(np.float32)
    painted = np.concatenate([np.full_like(photo, 0.8), alpha], -1)
    assert iou(propose(painted, Prompts(points=(ON_BALL,))), BALL) > 0.95


def test_full_box_marks_the_photo_and_a_negative_click_alone_is_rejected(photo):
    assert propose(photo, Prompts(box=(0.0, 0.0, WIDTH, HEIGHT))).all()
    with pytest.raises(BadRequest, match="where the object is"):
        propose(photo, Prompts(points=(ON_WALL,)))
