"""The simulated hand: what it takes for an error, and where its strokes lie."""

import numpy as np
import pytest

pytest.importorskip("scipy")

from tools.marking.hand import HANDS, along, can_be_hit, largest_error, short_line

ROWS, COLUMNS = np.mgrid[:60, :90]
AWAY = np.hypot(ROWS - 55, COLUMNS - 45)
ARCH = (AWAY > 30) & (AWAY < 42)
TURN = np.arctan2(55 - ROWS, COLUMNS - 45)


def test_the_larger_error_is_found_and_whether_the_object_is_missing_there():
    true = np.zeros((60, 90), bool)
    true[10:30, 10:40] = True
    found = true.copy()
    found[10:30, 30:40] = False
    found[50:55, 50:60] = True
    error, is_missing = largest_error(found, true, np.ones_like(true))
    assert is_missing and error.sum() == 200
    error, is_missing = largest_error(found, true, ~true)
    assert not is_missing and error.sum() == 50


def test_strips_along_borders_are_not_hit_by_a_brush():
    strip = np.zeros((60, 90), bool)
    assert not can_be_hit(strip)
    strip[20:22, 10:80] = True
    assert not can_be_hit(strip)
    strip[20:25, 10:20] = True
    assert can_be_hit(strip)


@pytest.mark.parametrize("hand", HANDS)
def test_strokes_stay_inside_an_error(hand):
    stroke = HANDS[hand](ARCH)
    assert stroke.any() and not (stroke & ~ARCH).any()


def test_a_stroke_along_an_error_follows_it_to_both_ends_and_a_line_does_not():
    ends = (TURN < 0.4, TURN > np.pi - 0.4)
    assert all((along(ARCH) & end).any() for end in ends)
    assert not any((short_line(ARCH) & end).any() for end in ends)
