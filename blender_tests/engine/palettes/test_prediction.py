"""What a colorway reaches is known before anything is rendered, and why not closer."""

import numpy as np
import pytest

from karf_engine.io.color import ciede2000, linear_to_srgb, srgb_to_lab, srgb_to_linear
from karf_engine.palettes.color_histogram import ColorHistogram
from karf_engine.palettes.palette import Palette
from karf_engine.palettes.prediction import (
    TargetColor,
    dominant_color,
    edited_colors,
    predict,
    reached_color,
    reason_in_view,
)

PALETTE = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.15], [1, 1, 0.95]], np.float32))
SHADES = np.linspace(0.05, 0.8, 40)


def red_pot() -> ColorHistogram:
    """A red pot with a little gloss: shades of one paint, most of them in the middle."""
    gloss = 0.1 * SHADES**8
    weights = np.stack([1 - SHADES - gloss, SHADES, gloss], axis=1)
    counts = 100 * np.exp(-(((SHADES - 0.5) / 0.2) ** 2))
    return ColorHistogram(weights @ PALETTE.colors, counts, weights)


def target_color(color, source=None) -> TargetColor:
    return TargetColor("pot", srgb_to_lab(np.array(color)), source, "sheet.csv, line 2")


def test_the_dominant_color_is_where_most_pixels_are():
    seen = red_pot()
    middle = seen.colors[np.abs(SHADES - 0.5).argmin()]
    assert ciede2000(srgb_to_lab(dominant_color(seen)), srgb_to_lab(middle)) < 2


@pytest.mark.parametrize("color", [(0.2, 0.3, 0.6), (0.5, 0.5, 0.5), (0.1, 0.4, 0.2), (0.8, 0.7, 0.2)])
def test_a_color_within_reach_is_reached(color):
    seen = red_pot()
    prediction = predict(target_color(color), PALETTE, seen)
    assert prediction.ciede2000 < 1 and not prediction.reason
    after = edited_colors(seen, PALETTE, prediction.colors)
    at_source = np.linalg.norm(seen.colors - prediction.source, axis=1).argmin()
    assert ciede2000(srgb_to_lab(after[at_source]), srgb_to_lab(np.array(color))) < 3


def test_the_difference_is_to_the_wish_itself_also_where_no_screen_shows_it():
    violet = TargetColor("pot", np.array([60.0, 90, -90]), None, "sheet.csv, line 2")
    prediction = predict(violet, PALETTE, red_pot())
    assert "no sRGB picture can show it" in prediction.reason
    assert prediction.ciede2000 == pytest.approx(ciede2000(srgb_to_lab(prediction.reached), violet.lab))
    assert (prediction.target <= 1).all() and (prediction.target >= 0).all()


def test_too_little_light_is_told_as_the_cause():
    dark = red_pot().colors[2]
    prediction = predict(target_color((0.9, 0.9, 0.9), dark), PALETTE, red_pot())
    assert "too little light falls there" in prediction.reason and prediction.ciede2000 > 10


def test_a_color_that_the_object_does_not_show_is_told():
    prediction = predict(target_color((0.2, 0.3, 0.6), np.array([0.1, 0.8, 0.3])), PALETTE, red_pot())
    assert "shows no color like #1acc4c" in prediction.reason


def test_a_black_source_is_told():
    prediction = predict(target_color((0.2, 0.3, 0.6), np.zeros(3)), PALETTE, red_pot())
    assert "is black" in prediction.reason and np.array_equal(prediction.colors, PALETTE.colors)


def test_locked_swatches_stay_and_are_told_as_the_cause():
    prediction = predict(target_color((0.2, 0.3, 0.6)), PALETTE, red_pot(), locked=(1, 2))
    assert np.array_equal(prediction.colors, PALETTE.colors) and "locked swatches" in prediction.reason
    half = predict(target_color((0.2, 0.3, 0.6)), PALETTE, red_pot(), locked=(2,))
    assert np.array_equal(half.colors[2], PALETTE.colors[2]) and not half.reason


def test_white_says_that_lit_parts_would_be_brighter():
    light = srgb_to_linear(red_pot().colors) * 1.4
    lit = ColorHistogram(linear_to_srgb(light).clip(0, 1), *red_pot()[1:])
    prediction = predict(target_color((1, 1, 1), np.array([0.4, 0.09, 0.07])), PALETTE, lit)
    assert prediction.reason and prediction.ciede2000 > 2


def test_what_is_reached_is_the_source_with_the_median_change_near_it():
    rng = np.random.default_rng(0)
    before = rng.normal((0.5, 0.3, 0.3), 0.004, (500, 3))
    after = before + (0.1, 0.2, -0.1)
    after[:200] = rng.uniform(0, 1, (200, 3))  # others cover them
    source = np.array([0.505, 0.3, 0.3])
    np.testing.assert_allclose(reached_color(before, after, source), source + (0.1, 0.2, -0.1), atol=0.02)
    weights = np.r_[np.zeros(200), np.ones(300)]
    np.testing.assert_allclose(reached_color(before, after, source, weights), source + (0.1, 0.2, -0.1), atol=1e-9)


def test_a_lock_is_told_as_the_cause_where_it_would_be_reached_without():
    two = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.15], [0.8, 0.3, 0.2]], np.float32))
    weights = np.array([[0.0, 0.7, 0.3]])
    seen = ColorHistogram(weights @ two.colors, np.array([1]), weights)
    free, held = (predict(target_color((0.05, 0.2, 0.6)), two, seen, locked) for locked in ((), (0, 1)))
    assert not free.reason and held.ciede2000 > 2
    assert held.reason == "locks hold it: without that of swatch 1 it would be reached"


def test_a_lock_that_changes_nothing_is_not_the_cause():
    dark = red_pot().colors[2]
    prediction = predict(target_color((0.9, 0.9, 0.9), dark), PALETTE, red_pot(), (2,))
    assert "too little light falls there" in prediction.reason


def test_a_view_names_the_channel_that_ends_at_white():
    prediction = predict(target_color((0.2, 0.3, 0.6)), PALETTE, red_pot())
    assert reason_in_view(prediction, prediction.reached) == ""
    assert reason_in_view(prediction, np.array([0.2, 0.3, 1.0])) == "its blue is as bright here as a picture can show"
    assert "otherwise here" in reason_in_view(prediction, np.array([0.2, 0.5, 0.6]))
