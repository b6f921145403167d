"""The judge's figures, on pictures small enough to work out by hand."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.metrics.images import hue_shift, ssim
from tools.metrics.scores import (
    hue_shifted,
    palette_picture,
    score_masks,
    score_palettes,
    score_pictures,
    score_recolor,
)


def square(size, low, high):
    mask = np.zeros((size, size), bool)
    mask[low:high, low:high] = True
    return mask


def test_masks_are_scored_over_the_views_that_show_the_object():
    truth, exact, half = square(40, 10, 20), square(40, 10, 20), square(40, 10, 20)
    half[:, :15] = False
    hidden, anything = square(40, 0, 3), square(40, 0, 40)
    score = score_masks([exact, half, anything], [truth, truth, hidden])
    assert_allclose([score.iou, score.worst], [0.75, 0.5])


def test_pooled_iou_counts_pixels_and_accuracy_counts_the_whole_picture():
    large, small, half = square(40, 0, 30), square(40, 10, 20), square(40, 10, 20)
    half[:, :15] = False
    score = score_masks([large, half], [large, small])
    assert_allclose(score.iou, (1 + 0.5) / 2)
    assert_allclose(score.pooled, (900 + 50) / (900 + 100))
    assert_allclose(score.accuracy, (1 + 1550 / 1600) / 2)


def test_an_error_of_one_pixel_at_the_border_is_forgiven_by_the_second_figure():
    score = score_masks([square(40, 9, 21)], [square(40, 10, 20)])
    assert score.iou == pytest.approx(100 / 144)
    assert score.iou_border_excluded == 1


def test_the_palette_picture_is_each_objects_own_mix():
    weights = np.zeros((2, 3, 1, 2), np.float16)
    weights[0, :, 0, 0] = [0.25, 0.25, 0.0]  # half of the pixel is the object
    weights[1, :, 0, 1] = [0.0, 0.0, 1.0]
    palettes = np.array([[[0, 0, 0], [1, 0.5, 0], [0, 0, 1]], [[0, 0, 0], [0, 0, 0], [0.2, 0.4, 0.6]]])
    picture = palette_picture(weights, weights.sum(1), palettes)
    assert picture.shape == (2, 1, 2, 3)
    assert_allclose(picture[0, 0], [[0.5, 0.25, 0], [0, 0, 0]], atol=1e-3)
    assert_allclose(picture[1, 0], [[0, 0, 0], [0.2, 0.4, 0.6]], atol=1e-3)


def test_palettes_are_scored_on_black_in_the_frame_and_alone_inside_the_objects():
    random = np.random.default_rng(1)
    photo, mask = random.uniform(0.2, 0.8, (20, 20, 3)), square(20, 5, 15)
    palettes = np.array([[[0, 0, 0], [0.6, 0.4, 0.2]]])
    photo[mask] = palettes[0, 1]
    exact = np.stack([np.zeros_like(mask), mask])[None].astype(np.float32)
    score = score_palettes([exact], [exact.sum(1)], palettes, [photo], [mask[None]])
    assert score.psnr_frame > 100 and score.psnr_object > 100
    assert_allclose([score.ssim_frame, score.ssim_object], 1, atol=1e-6)
    # half of the object's probability: its own color inside, but the frame is darker
    half = score_palettes([exact / 2], [exact.sum(1) / 2], palettes, [photo], [mask[None]])
    assert half.psnr_object > 100
    missing = ((palettes[0, 1] / 2) ** 2).mean() * 0.25
    assert half.psnr_frame == pytest.approx(-10 * math.log10(missing), rel=1e-6)


def test_ssim_of_a_mask_ignores_what_is_far_from_it():
    random = np.random.default_rng(2)
    first = random.random((40, 40, 3))
    second = first.copy()
    second[:, 25:] = random.random((40, 15, 3))
    left = np.zeros((40, 40), bool)
    left[10:30, 6:18] = True
    assert ssim(first, second, left) == pytest.approx(1) and ssim(first, second) < 0.8
    assert math.isnan(ssim(first, second, np.zeros((40, 40), bool)))


@pytest.fixture
def recolor():
    random = np.random.default_rng(0)
    photo = np.clip([0.8, 0.2, 0.2] + random.normal(scale=0.03, size=(24, 24, 3)), 0, 1)
    mask = square(24, 6, 18)
    pair = (np.array([0.8, 0.2, 0.2]), np.array([0.2, 0.2, 0.8]))
    truth = np.where(mask[..., None], hue_shift(photo, *pair), photo)
    return photo, mask, truth, pair


def test_a_perfect_edit_has_no_error_and_a_leak_is_charged_outside_the_mask(recolor):
    photo, mask, truth, pair = recolor
    perfect = score_recolor([hue_shifted(photo, {"pot": mask}, {"pot": pair})], [truth], [photo], [mask])
    assert (perfect.ciede2000, perfect.mse_outside, perfect.psnr) == (0, 0, math.inf)
    leaky = truth.copy()
    leaky[0, 0] = 1 - leaky[0, 0]
    score = score_recolor([leaky], [truth], [photo], [mask])
    assert score.ciede2000 == 0
    expected = ((1 - 2 * photo[0, 0]) ** 2).sum() / (3 * (24 * 24 - 144))
    assert score.mse_outside == pytest.approx(expected, rel=1e-6)


def test_a_recolor_is_scored_against_its_truth_inside_and_its_photo_outside(recolor):
    photo, mask, truth, _ = recolor
    score = score_recolor([truth, photo], [truth, truth], [photo, photo], [mask, mask])
    assert score.mse_outside == 0 and score.ciede2000 > 10
    assert score.ciede2000 == score_recolor([photo], [truth], [photo], [mask]).ciede2000 / 2


def test_pictures_are_scored_by_mean_and_worst():
    black = np.zeros((16, 16, 3))
    assert score_pictures([black + 0.1, black + 0.01], [black, black]) == pytest.approx((30, 20))
