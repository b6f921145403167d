"""Color conversions and differences, compared with published values."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.io.color import ciede2000, lab_to_srgb, linear_to_srgb, srgb_to_lab, srgb_to_linear


def test_lab_of_primaries_matches_published_values():
    srgb = [[1, 1, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    lab = [[100, 0, 0], [0, 0, 0], [53.24, 80.09, 67.20], [87.73, -86.18, 83.18], [32.30, 79.19, -107.86]]
    assert_allclose(srgb_to_lab(np.array(srgb, float)), lab, atol=0.01)  # D65, 2 degrees


def test_srgb_curve_matches_published_points_and_inverts():
    # 0.5 -> 0.2140; the linear piece ends at 0.04045 / 12.92
    assert_allclose(srgb_to_linear([0, 0.04045, 0.5, 1]), [0, 0.0031308, 0.2140411, 1], atol=1e-7)
    values = np.linspace(0, 1, 1001)
    assert_allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-7)


def test_lab_conversion_inverts_outside_the_srgb_gamut():
    srgb = np.random.default_rng(0).uniform(-0.2, 1.4, (500, 3)).clip(0.01)
    assert_allclose(lab_to_srgb(srgb_to_lab(srgb)), srgb, atol=1e-6)
    assert (lab_to_srgb(np.array([60.0, 90, -90])) > 1).any()  # a violet outside the gamut


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
def test_ciede2000_matches_published_values(first, second, difference):
    assert_allclose([ciede2000(first, second), ciede2000(second, first)], difference, atol=1e-4)


def test_ciede2000_matches_scikit_image():
    skimage = pytest.importorskip("skimage.color")
    lab = np.random.default_rng(0).uniform((0, -90, -90), (100, 90, 90), (2, 20000, 3))
    assert_allclose(ciede2000(*lab), skimage.deltaE_ciede2000(*lab), atol=1e-9)
