"""Scores of tiny pictures worked out by hand, and the true recolors that they compare with."""

import math

import imageio.v3 as iio
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.io.files import write_json
from karf_engine.metrics.images import hue_shift, ssim
from tools.metrics.scores import (
    hue_shifted,
    palette_picture,
    score_masks,
    score_palettes,
    score_pictures,
    score_recolor,
)
from tools.metrics.truth import Truth

RED, GREEN, BLUE, CREAM = np.array([(0.7, 0.1, 0.1), (0.1, 0.5, 0.2), (0.1, 0.2, 0.7), (0.8, 0.8, 0.6)])


def square(size, low, high):
    mask = np.zeros((size, size), bool)
    mask[low:high, low:high] = True
    return mask


SMALL, LARGE, HALF = square(40, 10, 20), square(40, 0, 30), square(40, 10, 20)
HALF[:, :15] = False


def test_mask_scores_skip_views_with_hardly_any_object():
    score = score_masks([SMALL, HALF, square(40, 0, 40)], [SMALL, SMALL, square(40, 0, 3)])
    assert_allclose([score.iou, score.worst], [0.75, 0.5])


def test_pooled_iou_and_accuracy_count_pixels():
    score = score_masks([LARGE, HALF], [LARGE, SMALL])
    expected = [(1 + 0.5) / 2, (900 + 50) / (900 + 100), (1 + 1550 / 1600) / 2]
    assert_allclose([score.iou, score.pooled, score.accuracy], expected)


def test_border_excluded_iou_ignores_one_pixel():
    score = score_masks([square(40, 9, 21)], [SMALL])
    assert_allclose([score.iou, score.iou_border_excluded], [100 / 144, 1])


def test_palette_picture_mixes_each_objects_colors():
    weights = np.zeros((2, 3, 1, 2), np.float16)
    weights[0, :, 0, 0] = [0.25, 0.25, 0.0]  # half of the pixel is the object
    weights[1, :, 0, 1] = [0.0, 0.0, 1.0]
    palettes = np.array([[[0, 0, 0], [1, 0.5, 0], [0, 0, 1]], [[0, 0, 0], [0, 0, 0], [0.2, 0.4, 0.6]]])
    expected = [[[[0.5, 0.25, 0], [0, 0, 0]]], [[[0, 0, 0], [0.2, 0.4, 0.6]]]]
    picture = palette_picture(weights, weights.sum(1), palettes)
    assert picture.shape == (2, 1, 2, 3)
    assert_allclose(picture, expected, atol=1e-3)


def test_palette_scores_cover_frame_and_objects():
    photo, mask = np.random.default_rng(1).uniform(0.2, 0.8, (20, 20, 3)), square(20, 5, 15)
    palettes = np.array([[[0, 0, 0], [0.6, 0.4, 0.2]]])
    photo[mask] = palettes[0, 1]
    exact = np.stack([np.zeros_like(mask), mask])[None].astype(np.float32)
    score = score_palettes([exact], [exact.sum(1)], palettes, [photo], [mask[None]])
    assert score.psnr_frame > 100 and score.psnr_object > 100
    assert_allclose([score.ssim_frame, score.ssim_object], 1, atol=1e-6)
    # with half the probability, the color inside stays but the frame is darker
    half = score_palettes([exact / 2], [exact.sum(1) / 2], palettes, [photo], [mask[None]])
    missing = ((palettes[0, 1] / 2) ** 2).mean() * 0.25
    assert half.psnr_object > 100
    assert half.psnr_frame == pytest.approx(-10 * math.log10(missing), rel=1e-6)


def test_masked_ssim_ignores_distant_pixels():
    first, second = np.random.default_rng(2).random((2, 40, 40, 3))
    second[:, :25] = first[:, :25]
    left = np.zeros((40, 40), bool)
    left[10:30, 6:18] = True
    assert ssim(first, second, left) == pytest.approx(1) and ssim(first, second) < 0.8
    assert math.isnan(ssim(first, second, np.zeros((40, 40), bool)))


def test_recolor_is_compared_to_truth_inside_and_photo_outside():
    pair = np.array([0.8, 0.2, 0.2]), np.array([0.2, 0.2, 0.8])
    photo = np.clip(pair[0] + np.random.default_rng(0).normal(scale=0.03, size=(24, 24, 3)), 0, 1)
    mask = square(24, 6, 18)
    truth = np.where(mask[..., None], hue_shift(photo, *pair), photo)
    perfect = score_recolor([hue_shifted(photo, {"pot": mask}, {"pot": pair})], [truth], [photo], [mask])
    assert (perfect.ciede2000, perfect.mse_outside, perfect.psnr) == (0, 0, math.inf)
    leaky = truth.copy()
    leaky[0, 0] = 1 - leaky[0, 0]
    score = score_recolor([leaky], [truth], [photo], [mask])
    leak = ((1 - 2 * photo[0, 0]) ** 2).sum() / (3 * (24 * 24 - 144))
    assert (score.ciede2000, score.mse_outside) == (0, pytest.approx(leak, rel=1e-6))
    score = score_recolor([truth, photo], [truth, truth], [photo, photo], [mask, mask])
    assert score.mse_outside == 0 and score.ciede2000 > 10
    assert score.ciede2000 == score_recolor([photo], [truth], [photo], [mask]).ciede2000 / 2


def test_picture_scores_are_mean_and_worst():
    black = np.zeros((16, 16, 3))
    assert score_pictures([black + 0.1, black + 0.01], [black, black]) == pytest.approx((30, 20))


def truth_with(folder, edit, names, pictures):
    """Write a capture with these pictures and return its truth."""
    for path, picture in pictures.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        iio.imwrite(folder / path, np.rint(255 * picture).astype(np.uint8))
    write_json(folder / "edits.json", {"edits": {"new": edit}})
    write_json(folder / "labels" / "names.json", names)
    return Truth(folder)


def test_transparent_recolors_are_placed_on_white(tmp_path):
    picture = np.array([[(1, 0, 0, 1), (1, 0, 0, 0.2), (0, 0, 0, 0)]])
    (recolored,) = truth_with(tmp_path, {}, {}, {"recolor/new/test/r_000.png": picture}).recolored("new")
    assert_allclose(recolored[0], [(1, 0, 0), (1, 0.8, 0.8), (1, 1, 1)])


def lit(*paints):
    """Stripes of paints, each from shade to light."""
    shades = np.linspace(0.3, 1, 12)[None, :, None]
    return np.concatenate([linear_to_srgb(shades * srgb_to_linear(paint)) for paint in paints], 0)


@pytest.mark.parametrize(
    ("before", "after", "pairs"),
    [
        ([RED, CREAM, RED], [GREEN, BLUE, GREEN], [(RED, GREEN), (CREAM, BLUE)]),  # the most frequent one first
        ([RED, RED], [BLUE, BLUE], [(RED, BLUE)]),  # light and shade count as one
        ([RED], [RED], [(RED, RED)]),  # nothing changes inside the mask
    ],
)
def test_repainted_paints_are_paired(tmp_path, before, after, pairs):
    pictures = {
        "train/r_000.png": lit(*before),
        "recolor/new/train/r_000.png": lit(*after),
        "coarse_masks/one/pot/r_000.png": np.ones((len(before), 12)),
    }
    truth = truth_with(tmp_path, {"objects": ["pot"], "reference_view": "r_000"}, {"pot": 1}, pictures)
    found = truth.paint_pairs("new", "pot")
    assert len(found) == len(pairs) and np.isfinite(truth.color_pair("new", "pot")).all()
    if np.array_equal(before, after):
        assert_array_equal(*found[0])
        return
    for color, paint in zip(np.reshape(found, (-1, 3)), np.reshape(pairs, (-1, 3)), strict=True):
        shade = srgb_to_linear(color) / srgb_to_linear(paint)
        assert_allclose(shade, shade.mean(), rtol=0.06)  # from the lit half of one paint
        assert shade.mean() > 0.65
