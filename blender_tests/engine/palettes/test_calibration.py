"""The light of a photo, estimated from a gray card or a color chart in it."""

import numpy as np
import pytest

from blender_tests.engine.drawn_chart import CAST, CORNERS, photo_of_chart
from karf_engine.errors import BadRequest
from karf_engine.io.color import lab_to_srgb, linear_to_srgb, srgb_to_linear
from karf_engine.io.images import write_png
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.calibration import (
    PATCHES,
    ReferenceLight,
    fit_chart,
    fit_photo,
    patch_colors,
    reference_colors,
)
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.session import Session

LAMP = np.diag([1.3, 0.9, 0.5])  # a warm light, and an exposure
PAINTS = lab_to_srgb(np.array([[50.0, 40, 20], [30, -10, -30], [60, -20, 40], [70, 5, 60]]))


@pytest.fixture(scope="module")
def photo():
    return photo_of_chart()


def expose(color, light=CAST):
    return linear_to_srgb(srgb_to_linear(color) @ light.T)


@pytest.mark.parametrize("lightness", [None, 30.0, 70.0])
def test_card_recovers_paints_under_the_reference_light(lightness):
    card = expose(lab_to_srgb(np.array([lightness or 50.0, 0, 0])), LAMP)
    light = ReferenceLight.of_card(card, lightness) if lightness else ReferenceLight.of_card(card)
    np.testing.assert_allclose(light.matrix, LAMP, rtol=1e-6, atol=1e-12)
    assert mean_ciede2000(light.reference(expose(PAINTS, LAMP)), PAINTS) < 0.01
    assert mean_ciede2000(light.photographed(PAINTS), expose(PAINTS, LAMP)) < 0.01


@pytest.mark.parametrize(
    ("card", "lightness"), [((0.01, 0.5, 0.5), 50), ((0.5, 1.0, 0.5), 50), ((0.5,) * 3, 0), ((0.5,) * 3, 101)]
)
def test_uninformative_cards_are_rejected(card, lightness):
    with pytest.raises(BadRequest, match="card"):
        ReferenceLight.of_card(np.array(card), lightness)


def test_chart_recovers_the_light_of_a_noisy_slanted_photo(photo):
    fit = fit_photo(photo, CORNERS)
    np.testing.assert_allclose(fit.light.matrix, CAST, atol=0.005)
    assert fit.mean_residual < 0.3
    assert mean_ciede2000(fit.light.reference(expose(PAINTS)), PAINTS) < 0.3
    assert mean_ciede2000(fit.light.photographed(PAINTS), expose(PAINTS)) < 0.3
    # a gray card alone cannot undo a cast that mixes channels
    card = ReferenceLight.of_card(patch_colors(photo, CORNERS)[21], PATCHES[21][1])
    assert mean_ciede2000(card.reference(expose(PAINTS)), PAINTS) > 3


@pytest.mark.parametrize(
    ("corners", "tolerance"),
    [
        (np.roll(CORNERS, 1, axis=0), 0),
        (np.roll(CORNERS, 2, axis=0)[::-1], 0),
        (CORNERS + np.array([[-6, 5], [6, 4], [5, -6], [-5, -5]]), 0.01),
    ],
    ids=["another start", "reversed", "inexact"],
)
def test_corner_order_and_small_errors_do_not_matter(photo, corners, tolerance):
    expected = fit_photo(photo, CORNERS).light.matrix
    np.testing.assert_allclose(fit_photo(photo, corners).light.matrix, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("begin", [0, 2], ids=["upright", "upside down"])
def test_worker_finds_the_chart_and_its_light_in_a_photo(tmp_path, begin):
    write_png(tmp_path / "chart.png", photo_of_chart(corners=np.roll(CORNERS, begin, axis=0)))
    answer = QUERIES["chart"](Session(tmp_path), {"photo": str(tmp_path / "chart.png")})
    np.testing.assert_allclose(np.reshape(answer["light"], (3, 3)), CAST, atol=0.01)
    assert answer["left"] < 1
    write_png(tmp_path / "wall.png", np.full((200, 300, 3), 0.5))
    with pytest.raises(BadRequest, match=r"No color chart was found in .*wall\.png"):
        QUERIES["chart"](Session(tmp_path), {"photo": str(tmp_path / "wall.png")})


def test_clipped_patches_are_ignored():
    fit = fit_chart(np.clip(linear_to_srgb(srgb_to_linear(reference_colors()) * 1.5), 0, 1))
    np.testing.assert_allclose(fit.light.matrix, 1.5 * np.eye(3), atol=1e-6)
    assert np.isnan(fit.residuals[18])  # white


def test_worst_patch_is_named_and_a_dark_chart_is_rejected():
    seen = reference_colors().clip(0, 1)
    seen[14] = [0.2, 0.3, 0.7]  # a finger on the red
    assert "(red)" in str(fit_chart(seen))
    with pytest.raises(BadRequest, match="neither too dark"):
        fit_chart(seen * 0.05)


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        (CORNERS[[0, 2, 1, 3]], "not those of a color chart"),  # crossed
        (CORNERS + [400, 0], "not those of a color chart"),  # beyond the photo
        ([[10, 10], [90, 10], [90, 60], [10, 60]], "patches are neither|does not look like"),  # beside the chart
    ],
)
def test_impossible_chart_corners_are_rejected(photo, corners, words):
    with pytest.raises(BadRequest, match=words):
        fit_photo(photo, np.array(corners, float))
