"""Color science against published tables."""

from __future__ import annotations

import numpy as np
import pytest

from karf_engine.io import color


@pytest.mark.parametrize(
    ("srgb", "lab"),
    [  # published Lab values of the sRGB primaries (D65, 2 degrees)
        ([1, 1, 1], [100, 0, 0]),
        ([0, 0, 0], [0, 0, 0]),
        ([1, 0, 0], [53.24, 80.09, 67.20]),
        ([0, 1, 0], [87.73, -86.18, 83.18]),
        ([0, 0, 1], [32.30, 79.19, -107.86]),
    ],
)
def test_lab_of_primaries_is_as_published(srgb: list[float], lab: list[float]) -> None:
    np.testing.assert_allclose(color.srgb_to_lab(np.array(srgb, float)), lab, atol=0.01)


def test_srgb_curve_has_its_published_points_and_inverts() -> None:
    # 0.5 -> 0.2140; the linear piece ends at 0.04045 / 12.92
    np.testing.assert_allclose(color.srgb_to_linear([0, 0.04045, 0.5, 1]), [0, 0.0031308, 0.2140411, 1], atol=1e-7)
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(color.linear_to_srgb(color.srgb_to_linear(values)), values, atol=1e-7)


def test_lab_inverts_also_beyond_what_a_screen_shows() -> None:
    srgb = np.random.default_rng(0).uniform(-0.2, 1.4, (500, 3)).clip(0.01)
    np.testing.assert_allclose(color.lab_to_srgb(color.srgb_to_lab(srgb)), srgb, atol=1e-6)
    assert (color.lab_to_srgb(np.array([60.0, 90, -90])) > 1).any()  # no screen has this violet


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [  # supplementary test data of Sharma, Wu and Dalal (2005): pairs 1, 4, 7, 9, 11, 13, 17, 20, 25 and 34
        ([50, 2.6772, -79.7751], [50, 0, -82.7485], 2.0425),
        ([50, -1.3802, -84.2814], [50, 0, -82.7485], 1.0000),
        ([50, 0, 0], [50, -1, 2], 2.3669),
        ([50, 2.49, -0.001], [50, -2.49, 0.0009], 7.1792),
        ([50, 2.49, -0.001], [50, -2.49, 0.0011], 7.2195),
        ([50, -0.001, 2.49], [50, 0.0009, -2.49], 4.8045),
        ([50, 2.5, 0], [73, 25, -18], 27.1492),
        ([50, 2.5, 0], [58, 24, 15], 19.4535),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
    ],
)
def test_ciede2000_is_as_published(first: list[float], second: list[float], difference: float) -> None:
    assert color.ciede2000(first, second) == pytest.approx(difference, abs=1e-4)
    assert color.ciede2000(second, first) == pytest.approx(difference, abs=1e-4)


def test_ciede2000_is_that_of_scikit_image() -> None:
    skimage = pytest.importorskip("skimage.color")
    lab = np.random.default_rng(0).uniform((0, -90, -90), (100, 90, 90), (2, 20000, 3))
    np.testing.assert_allclose(color.ciede2000(*lab), skimage.deltaE_ciede2000(*lab), atol=1e-9)
