"""A gray card in a photo tells what a color of a book looks like in the photos, and back."""

import numpy as np
import pytest

from karf_engine.errors import BadRequest
from karf_engine.io.color import lab_to_srgb, linear_to_srgb, srgb_to_lab, srgb_to_linear
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.calibration import ReferenceLight

LAMP = np.array([1.3, 0.9, 0.5])  # a warm light, and an exposure
PAINTS = lab_to_srgb(np.array([[50.0, 40, 20], [30, -10, -30], [60, -20, 40]]))


def seen_under_the_lamp(color):
    return linear_to_srgb(srgb_to_linear(color) * LAMP)


def test_paints_that_were_photographed_with_a_card_are_known_under_the_reference_light():
    light = ReferenceLight.of_card(seen_under_the_lamp(lab_to_srgb(np.array([50.0, 0, 0]))))
    np.testing.assert_allclose(light.matrix, np.diag(LAMP), rtol=1e-6)
    assert mean_ciede2000(light.reference(seen_under_the_lamp(PAINTS)), PAINTS) < 0.01
    assert mean_ciede2000(light.photographed(PAINTS), seen_under_the_lamp(PAINTS)) < 0.01


def test_a_card_of_another_lightness_tells_the_same():
    cards = [
        ReferenceLight.of_card(seen_under_the_lamp(lab_to_srgb(np.array([lightness, 0, 0]))), lightness)
        for lightness in (30.0, 70.0)
    ]
    np.testing.assert_allclose(cards[0].matrix, cards[1].matrix, rtol=1e-6)


def test_without_a_card_a_warm_light_makes_another_color_of_it():
    assert mean_ciede2000(PAINTS, seen_under_the_lamp(PAINTS)) > 8
    assert np.linalg.norm(srgb_to_lab(seen_under_the_lamp(PAINTS)) - srgb_to_lab(PAINTS), axis=1).min() > 5


@pytest.mark.parametrize(
    "card, lightness", [((0.01, 0.5, 0.5), 50), ((0.5, 1.0, 0.5), 50), ((0.5,) * 3, 0), ((0.5,) * 3, 101)]
)
def test_a_card_that_tells_nothing_is_refused(card, lightness):
    with pytest.raises(BadRequest, match="card"):
        ReferenceLight.of_card(np.array(card), lightness)
