"""Color science and metrics against published tables, brute force and hand arithmetic."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest

from karf_engine import color
from karf_engine.metrics import images as metrics

# Sharma, Wu, Dalal: The CIEDE2000 color-difference formula (2005), table 1: L a b, L a b, difference
SHARMA = """
50 2.6772 -79.7751  50 0 -82.7485  2.0425
50 3.1571 -77.2803  50 0 -82.7485  2.8615
50 2.8361 -74.0200  50 0 -82.7485  3.4412
50 -1.3802 -84.2814  50 0 -82.7485  1.0000
50 -1.1848 -84.8006  50 0 -82.7485  1.0000
50 -0.9009 -85.5211  50 0 -82.7485  1.0000
50 0 0  50 -1 2  2.3669
50 -1 2  50 0 0  2.3669
50 2.4900 -0.0010  50 -2.4900 0.0009  7.1792
50 2.4900 -0.0010  50 -2.4900 0.0010  7.1792
50 2.4900 -0.0010  50 -2.4900 0.0011  7.2195
50 2.4900 -0.0010  50 -2.4900 0.0012  7.2195
50 -0.0010 2.4900  50 0.0009 -2.4900  4.8045
50 -0.0010 2.4900  50 0.0010 -2.4900  4.8045
50 -0.0010 2.4900  50 0.0011 -2.4900  4.7461
50 2.5 0  50 0 -2.5  4.3065
50 2.5 0  73 25 -18  27.1492
50 2.5 0  61 -5 29  22.8977
50 2.5 0  56 -27 -3  31.9030
50 2.5 0  58 24 15  19.4535
50 2.5 0  50 3.1736 0.5854  1.0000
50 2.5 0  50 3.2972 0  1.0000
50 2.5 0  50 1.8634 0.5757  1.0000
50 2.5 0  50 3.2592 0.3350  1.0000
60.2574 -34.0099 36.2677  60.4626 -34.1751 39.4387  1.2644
63.0109 -31.0961 -5.8663  62.8187 -29.7946 -4.0864  1.2630
61.2901 3.7196 -5.3901  61.4292 2.2480 -4.9620  1.8731
35.0831 -44.1164 3.7933  35.0232 -40.0716 1.5901  1.8645
22.7233 20.0904 -46.6940  23.0331 14.9730 -42.5619  2.0373
36.4612 47.8580 18.3852  36.2715 50.5065 21.2231  1.4146
90.8027 -2.0831 1.4410  91.1528 -1.6435 0.0447  1.4441
90.9257 -0.5406 -0.9208  88.6381 -0.8985 -0.7239  1.5381
6.7747 -0.2908 -2.4247  5.8714 -0.0985 -2.2286  0.6377
2.0776 0.0795 -1.1350  0.9033 -0.0636 -0.5514  0.9082
"""
PAIRS = np.array([line.split() for line in SHARMA.strip().splitlines()], float)


def test_ciede2000_gives_the_published_differences_both_ways() -> None:
    first, second, expected = PAIRS[:, :3], PAIRS[:, 3:6], PAIRS[:, 6]
    np.testing.assert_allclose(color.ciede2000(first, second), expected, atol=5.1e-5)
    np.testing.assert_allclose(color.ciede2000(second, first), expected, atol=5.1e-5)


def test_ciede2000_broadcasts_one_color_over_many() -> None:
    first, second = PAIRS[15, :3], PAIRS[15:20, 3:6]
    np.testing.assert_allclose(color.ciede2000(first, second), PAIRS[15:20, 6], atol=5.1e-5)


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


def test_hsv_agrees_with_the_standard_library() -> None:
    colors = np.vstack([np.random.default_rng(1).random((50, 3)), [[0, 0, 0], [0.5, 0.5, 0.5], [1, 0, 0], [1, 1, 0]]])
    expected = np.array([colorsys.rgb_to_hsv(*c) for c in colors])
    np.testing.assert_allclose(color.rgb_to_hsv(colors), expected, atol=1e-12)
    np.testing.assert_allclose(color.hsv_to_rgb(expected), colors, atol=1e-12)


def test_hue_shift_turns_red_to_green_and_leaves_grey() -> None:
    image = np.array([[[0.8, 0.2, 0.2], [0.4, 0.4, 0.4]]])
    shifted = color.hue_shift(image, np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    np.testing.assert_allclose(shifted, [[[0.2, 0.8, 0.2], [0.4, 0.4, 0.4]]], atol=1e-12)


def test_psnr_of_a_constant_error_is_its_decibels() -> None:
    first, mask = np.zeros((4, 4, 3)), np.eye(4, dtype=bool)
    second = first + 0.1
    assert metrics.psnr(first, second) == pytest.approx(20)
    second[mask] = 0.01
    assert metrics.psnr(first, second, mask) == pytest.approx(40)
    assert metrics.psnr(first, first) == float("inf")


def test_mse_outside_looks_outside_only() -> None:
    first, mask = np.zeros((2, 2, 3)), np.array([[True, False], [False, False]])
    second = first.copy()
    second[0, 0], second[0, 1] = 1, 0.3
    assert metrics.mse_outside(first, second, mask) == pytest.approx(0.09 / 3)
    assert metrics.mse_outside(first, second, np.ones_like(mask)) == 0


def test_ssim_equals_its_formula_window_by_window() -> None:
    random = np.random.default_rng(2)
    x = random.random((13, 12))
    y = np.clip(x + 0.2 * random.standard_normal(x.shape), 0, 1)
    grid = np.arange(-5, 6)
    window = np.exp(-(grid[:, None] ** 2 + grid**2) / (2 * 1.5**2))
    window /= window.sum()
    values = []
    for row in range(3):
        for column in range(2):
            a, b = x[row : row + 11, column : column + 11], y[row : row + 11, column : column + 11]
            ma, mb = (window * a).sum(), (window * b).sum()
            va, vb = (window * (a - ma) ** 2).sum(), (window * (b - mb) ** 2).sum()
            covariance = (window * (a - ma) * (b - mb)).sum()
            values.append((2 * ma * mb + 1e-4) * (2 * covariance + 9e-4) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4)))
    assert metrics.ssim(x, y) == pytest.approx(np.mean(values), abs=1e-12)
    assert metrics.ssim(x, x) == pytest.approx(1)
    with pytest.raises(ValueError, match="11"):
        metrics.ssim(x[:10], y[:10])


def test_mask_figures_of_two_overlapping_squares() -> None:
    truth, predicted = np.zeros((10, 10), bool), np.zeros((10, 10), bool)
    truth[2:8, 2:8] = True
    predicted[2:8, 3:9] = True
    assert metrics.iou(predicted, truth) == 30 / 42
    assert metrics.accuracy(predicted, truth) == 0.88
    # the two differing columns touch the truth's border
    assert metrics.iou_border_excluded(predicted, truth) == 1
    predicted[2:8, 3] = False
    predicted[2:8, 4] = False
    # inside the border 4 x 4 pixels count; columns 3 and 4 of them are missed
    assert metrics.iou_border_excluded(predicted, truth) == 0.5
    assert metrics.iou(truth & False, truth & False) == 1


def test_mean_difference_of_a_mask_ignores_the_rest() -> None:
    first, second = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    second[1] = 1
    mask = np.array([[True, True], [False, True]])
    # black against white differs by exactly 100
    assert metrics.mean_ciede2000(first, second, mask) == pytest.approx(100 / 3, abs=1e-6)
    assert np.isnan(metrics.mean_ciede2000(first, second, mask & False))
