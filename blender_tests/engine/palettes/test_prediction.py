"""Predictions, before rendering, of the color that a colorway reaches and of what keeps it away."""

import numpy as np
import pytest

from karf_engine.io.color import ciede2000, srgb_to_lab
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
GLOSS = 0.1 * SHADES**8
WEIGHTS = np.stack([1 - SHADES - GLOSS, SHADES, GLOSS], axis=1)
COUNTS = 100 * np.exp(-(((SHADES - 0.5) / 0.2) ** 2))
POT = ColorHistogram(WEIGHTS @ PALETTE.colors, COUNTS, WEIGHTS)  # shades of one paint, most of them in the middle
BLUE, WHITISH = (0.2, 0.3, 0.6), (0.9, 0.9, 0.9)
DARK = POT.colors[2]


def target_color(color, source=None):
    return TargetColor("pot", srgb_to_lab(np.array(color)), source, "sheet.csv, line 2")


@pytest.mark.parametrize("color", [BLUE, (0.5, 0.5, 0.5), (0.1, 0.4, 0.2), (0.8, 0.7, 0.2)])
def test_color_within_reach_is_reached_at_the_dominant_color(color):
    prediction = predict(target_color(color), PALETTE, POT)
    middle = srgb_to_lab(POT.colors[np.abs(SHADES - 0.5).argmin()])
    assert max(ciede2000(srgb_to_lab(each), middle) for each in (prediction.source, dominant_color(POT))) < 2
    assert prediction.ciede2000 < 1 and not prediction.reason
    after = edited_colors(POT, PALETTE, prediction.colors)
    at_source = np.linalg.norm(POT.colors - prediction.source, axis=1).argmin()
    assert ciede2000(srgb_to_lab(after[at_source]), srgb_to_lab(np.array(color))) < 3


def test_difference_is_measured_to_the_target_even_out_of_gamut():
    violet = TargetColor("pot", np.array([60.0, 90, -90]), None, "sheet.csv, line 2")
    prediction = predict(violet, PALETTE, POT)
    assert "no sRGB picture can show it" in prediction.reason
    assert prediction.ciede2000 == pytest.approx(ciede2000(srgb_to_lab(prediction.reached), violet.lab))
    assert (prediction.target <= 1).all() and (prediction.target >= 0).all()


@pytest.mark.parametrize(
    ("color", "source", "locked", "least", "reason"),
    [
        (WHITISH, DARK, (), 10, "too little light falls there"),
        (WHITISH, DARK, (2,), 10, "too little light falls there"),  # a lock without effect is not the cause
        ((0.98, 0.98, 0.98), POT.colors[25], (), 2, "better lit would be brighter than white"),
        (BLUE, np.array([0.1, 0.8, 0.3]), (), 10, "shows no color like #1acc4c"),
        (BLUE, np.zeros(3), (), 10, "is black"),
        (BLUE, None, (1, 2), 10, "locked swatches"),
    ],
)
def test_prediction_gives_the_reason(color, source, locked, least, reason):
    prediction = predict(target_color(color, source), PALETTE, POT, locked)
    assert reason in prediction.reason and prediction.ciede2000 > least
    if reason in ("is black", "locked swatches"):
        np.testing.assert_array_equal(prediction.colors, PALETTE.colors)


def test_locked_swatch_stays_and_is_named_as_the_cause_unless_the_color_has_none_of_it():
    prediction = predict(target_color(BLUE), PALETTE, POT, locked=(2,))
    assert np.array_equal(prediction.colors[2], PALETTE.colors[2]) and not prediction.reason
    four = Palette("pot", np.array([[0, 0, 0], [0.9, 0.2, 0.15], [0.8, 0.3, 0.2], [0.2, 0.8, 0.2]], np.float32))
    weights = np.array([[0.0, 0.7, 0.3, 0.0]])
    seen = ColorHistogram(weights @ four.colors, np.array([1]), weights)
    free, held = (predict(target_color((0.05, 0.2, 0.6)), four, seen, locked) for locked in ((), (0, 1, 3)))
    assert not free.reason and held.ciede2000 > 2
    assert held.reason == "locks hold it: without that of swatch 1 it would be reached"


def test_reached_color_adds_the_median_nearby_change():
    rng, change = np.random.default_rng(0), (0.1, 0.2, -0.1)
    before = rng.normal((0.5, 0.3, 0.3), 0.004, (500, 3))
    after = before + change
    after[:200] = rng.uniform(0, 1, (200, 3))  # covered by other objects
    source = np.array([0.505, 0.3, 0.3])
    np.testing.assert_allclose(reached_color(before, after, source), source + change, atol=0.02)
    weights = np.r_[np.zeros(200), np.ones(300)]
    np.testing.assert_allclose(reached_color(before, after, source, weights), source + change, atol=1e-9)


def test_clipped_channel_of_a_view_is_named():
    prediction = predict(target_color(BLUE), PALETTE, POT)
    assert reason_in_view(prediction, prediction.reached) == ""
    assert reason_in_view(prediction, np.array([0.2, 0.3, 1.0])) == "its blue is as bright here as a picture can show"
    assert "otherwise here" in reason_in_view(prediction, np.array([0.2, 0.5, 0.6]))
