"""Metrics of pictures and masks have the values found by hand."""

import numpy as np
import pytest

pytest.importorskip("skimage")

from karf_engine.metrics import images, masks


def test_hue_shift_turns_red_green_and_keeps_gray():
    image = np.array([[[0.8, 0.2, 0.2], [0.4, 0.4, 0.4]]])
    shifted = images.hue_shift(image, np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    np.testing.assert_allclose(shifted, [[[0.2, 0.8, 0.2], [0.4, 0.4, 0.4]]], atol=1e-12)


def test_masked_metrics_ignore_all_other_pixels():
    first, mask = np.zeros((4, 4, 3)), np.eye(4, dtype=bool)
    second = first + 0.1
    assert images.psnr(first, second) == pytest.approx(20)
    second[mask] = 0.01
    assert images.psnr(first, second, mask) == pytest.approx(40)
    assert images.psnr(first, first) == float("inf")
    assert images.mse_outside(first, second, mask) == pytest.approx(0.01)
    assert images.mse_outside(first, second, np.ones_like(mask)) == 0
    second[mask] = np.array([1, 0, 1, 0])[:, None]
    # black and white differ by exactly 100
    assert images.mean_ciede2000(first, second, mask) == pytest.approx(50, abs=1e-6)
    assert np.isnan(images.mean_ciede2000(first, second, mask & False))


def test_color_correction_removes_only_exposure_and_white_balance():
    random = np.random.default_rng(3)
    photo = random.uniform(0.2, 0.8, (20, 20, 3))
    exposed = photo * (1.1, 0.95, 0.8) + 0.02
    assert images.psnr(exposed, photo) < 25 < 100 < images.cc_psnr(exposed, photo)
    noise = 0.02 * random.standard_normal(photo.shape)
    plain = images.psnr(photo + noise, photo)
    assert plain < images.cc_psnr((photo + noise) * (1.1, 0.95, 0.8), photo) < plain + 1


def test_color_correction_ignores_clipped_pixels():
    photo = np.random.default_rng(4).uniform(0.2, 0.6, (20, 20, 3))
    clipped = photo.copy()
    clipped[:2] = 1
    corrected = images.color_correct(photo * 0.9, clipped)
    np.testing.assert_allclose(corrected[2:], photo[2:], atol=1e-6)
    white = photo.copy()
    white[..., 2] = 1
    np.testing.assert_array_equal(images.color_correct(photo * 0.9, white)[..., 2], photo[..., 2] * 0.9)


def test_ssim_equals_its_formula():
    random = np.random.default_rng(2)
    x = random.random((13, 12))
    y = np.clip(x + 0.2 * random.standard_normal(x.shape), 0, 1)
    grid = np.arange(-5, 6)
    window = np.exp(-(grid[:, None] ** 2 + grid**2) / (2 * 1.5**2))
    window /= window.sum()
    values = []
    for row, column in np.ndindex(3, 2):
        a, b = x[row : row + 11, column : column + 11], y[row : row + 11, column : column + 11]
        ma, mb = (window * a).sum(), (window * b).sum()
        va, vb = (window * (a - ma) ** 2).sum(), (window * (b - mb) ** 2).sum()
        covariance = (window * (a - ma) * (b - mb)).sum()
        values.append((2 * ma * mb + 1e-4) * (2 * covariance + 9e-4) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4)))
    assert images.ssim(x, y) == pytest.approx(np.mean(values), abs=1e-12)
    assert images.ssim(x, x) == pytest.approx(1)
    with pytest.raises(ValueError):
        images.ssim(x[:10], y[:10])


def test_mask_metrics_of_overlapping_squares():
    truth, predicted = np.zeros((2, 10, 10), bool)
    truth[2:8, 2:8] = True
    predicted[2:8, 3:9] = True
    assert masks.iou(predicted, truth) == 30 / 42
    assert masks.accuracy(predicted, truth) == 0.88
    # the two differing columns touch the truth's border
    assert masks.iou_border_excluded(predicted, truth) == 1
    predicted[2:8, 3:5] = False
    # 4 x 4 pixels count inside the border; columns 3 and 4 of them are missed
    assert masks.iou_border_excluded(predicted, truth) == 0.5
    assert masks.iou(truth & False, truth & False) == 1
