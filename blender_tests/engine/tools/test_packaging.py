"""The judge of recolored print: letters, rims and neutrals are told apart, and a letter that flips is found."""

from types import SimpleNamespace

import numpy as np
import pytest

from karf_engine.capture.camera import Camera
from karf_engine.io.files import write_json
from karf_engine.io.images import write_png
from tools.judging.packaging import Judge, flips, is_recolored, regions_of
from tools.judging.truth import Truth
from tools.metrics.consistency import DepthView

RED, GREEN, SILVER = np.array([(0.8, 0.1, 0.1), (0.1, 0.6, 0.2), (0.6, 0.6, 0.62)])
SIZE, EDGE = 48, 24  # a letter as a half plane: red left of EDGE, silver right of it


def letters_to(color, neutral=SILVER):
    """A picture whose left half is a letter of this color."""
    picture = np.empty((SIZE, SIZE, 3), np.float32)
    picture[:, :EDGE], picture[:, EDGE:] = color, neutral
    return picture


def capture_of(folder, views):
    """A capture of so many equal views that show one printed thing in the whole picture, and its truth."""
    shares = np.zeros((SIZE, SIZE), np.uint8)
    shares[:, :EDGE] = 255
    for number in range(views):
        file = f"test/r_{number:03d}.png"
        for path, pixels in {
            f"print/letters/{file}": shares,
            f"print/neutrals/{file}": 255 - shares,
            f"labels/{file}": np.ones((SIZE, SIZE), np.uint8),
            f"recolor/green/{file}": np.rint(255 * letters_to(GREEN)).astype(np.uint8),
            f"depth/{file}": np.full((SIZE, SIZE), 2000, np.uint16),
        }.items():
            write_png(folder / path, pixels)
    write_json(folder / "labels" / "names.json", {"can": 1})
    write_json(folder / "edits.json", {"edits": {"green": {"objects": ["can"]}}})
    return Truth(folder)


def camera(right=0.0):
    """A camera so many units right of the first, which looks at a wall 2 units away: a unit is 24 pixels."""
    pose = np.eye(4)
    pose[0, 3] = right
    return Camera(SIZE, SIZE, 48.0, 48.0, SIZE / 2, SIZE / 2, pose)


def judge_of(folder, views=3):
    """A judge of views that all are at one place."""
    judge = Judge.__new__(Judge)
    judge.truth, judge.views = capture_of(folder, views), [SimpleNamespace(camera=camera())] * views
    judge.photos = [letters_to(RED)] * views
    return judge


def test_the_true_recolor_is_perfect_and_the_photo_is_left_as_it_is(tmp_path):
    judge = judge_of(tmp_path)
    best, none = (judge.score("green", [letters_to(color)] * 3) for color in (GREEN, RED))
    assert best.letters == pytest.approx(0, abs=0.5) and (best.left, best.flips) == (0, 0)
    assert none.letters > 40 and (none.left, none.flips) == (1, 0)


def test_silver_that_takes_the_color_counts_for_neutrals_and_rims_and_not_for_letters(tmp_path):
    score = judge_of(tmp_path).score("green", [letters_to(GREEN, neutral=(0.5, 0.7, 0.6))] * 3)
    assert score.letters == pytest.approx(0, abs=0.5)
    assert score.neutrals > 10
    assert score.rims == pytest.approx(0.5 * score.neutrals, rel=0.1)  # half of the rim is silver


def test_a_letter_that_one_of_three_views_leaves_flips_twice(tmp_path):
    score = judge_of(tmp_path).score("green", [letters_to(GREEN), letters_to(RED), letters_to(GREEN)])
    assert (score.left, score.flips) == (pytest.approx(1 / 3), 1)


def test_points_are_followed_to_where_the_next_camera_shows_them():
    views = [DepthView(camera(right), np.full((SIZE, SIZE), 2.0), np.ones((SIZE, SIZE), bool)) for right in (0, 0.5)]
    states = [np.zeros((SIZE, SIZE), bool) for _ in views]
    states[0][:, 30:], states[1][:, 18:] = True, True  # the second camera shows all of it 12 pixels further left
    assert flips(states, views) == 0
    states[1][:, 21:] = False
    assert flips(states, views) == pytest.approx((SIZE - 33) / (SIZE - 12))
    hidden = DepthView(views[1].camera, np.full((SIZE, SIZE), 1.5), views[1].mask)
    assert np.isnan(flips(states, [views[0], hidden]))


def test_small_print_that_fills_no_pixel_belongs_to_the_rims():
    letters = np.zeros((9, 9))
    letters[4, 4] = 0.4
    regions = regions_of(letters, 1 - letters, np.ones((9, 9), bool))
    assert not regions.letters.any() and regions.rims.sum() == 1 and regions.neutrals.sum() == 80


def test_pixels_that_also_show_what_is_behind_the_object_are_not_judged():
    letters = np.full((4, 4), 0.5)
    regions = regions_of(letters, np.full((4, 4), 0.3), np.ones((4, 4), bool))
    assert not (regions.letters | regions.rims | regions.neutrals).any()


def test_where_a_highlight_hides_the_paint_nothing_can_be_told():
    white = np.ones((2, 2, 3))
    done, tells = is_recolored(white, white, white * 0.99)
    assert not tells.any() and not done.any()
