"""Two-level weights: convex, faithful to the color, local, and with corners where features stand out."""

import numpy as np
import pytest

from karf_engine.palettes.extraction.barycentric_weights import star_weights
from karf_engine.palettes.extraction.loco_weights import hull_corners, loco_weights

PALETTE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 1, 0]], np.float32)


@pytest.fixture
def pixels():
    """Colors inside the palette's hull that vary with the place, and places in picture sizes."""
    random = np.random.default_rng(0)
    places = random.random((600, 2))
    colors = 0.3 * np.stack([places[:, 0], places[:, 1], 1 - places[:, 0]], 1) + 0.1 * random.random((600, 3))
    return colors, places


def test_weights_are_convex_mixes_that_give_the_colors_back(pixels):
    colors, places = pixels
    weights = loco_weights(colors, places, PALETTE)
    assert weights.shape == (600, 6) and weights.dtype == np.float32
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    np.testing.assert_allclose(weights @ PALETTE, colors, atol=1e-5)


def test_corners_keep_the_weights_of_their_color_and_others_are_mixes_of_corners(pixels):
    colors, places = pixels
    weights, direct = loco_weights(colors, places, PALETTE), star_weights(colors, PALETTE)
    corners = hull_corners(np.concatenate([colors, places], 1))
    assert 20 < len(corners) < 600
    np.testing.assert_allclose(weights[corners], direct[corners], atol=1e-5)
    others = np.setdiff1d(np.arange(600), corners)
    assert np.abs(weights[others] - direct[others]).max() > 0.01


def test_a_color_may_have_other_weights_in_another_place(pixels):
    colors, places = pixels
    middle = np.array([[0.5, 0.42], [0.5, 0.58]])  # where such a color is nothing special
    same = np.concatenate([colors, np.full((2, 3), 0.2)]), np.concatenate([places, middle])
    first, second = loco_weights(*same, PALETTE)[-2:]
    np.testing.assert_allclose([first @ PALETTE, second @ PALETTE], 0.2, atol=1e-5)
    assert np.abs(first - second).max() > 1e-3


def test_a_pixel_whose_features_stand_out_becomes_a_corner(pixels):
    colors, places = pixels
    corners = hull_corners(np.concatenate([colors, places], 1))
    inner = int(np.setdiff1d(np.arange(600), corners)[0])
    features = np.random.default_rng(1).normal(size=(600, 8))
    features[inner] = 50
    direct = star_weights(colors, PALETTE)[inner]
    assert np.abs(loco_weights(colors, places, PALETTE)[inner] - direct).max() > 1e-4
    np.testing.assert_allclose(loco_weights(colors, places, PALETTE, features)[inner], direct, atol=1e-5)


@pytest.mark.parametrize("count", [1, 5, 50])
def test_pixels_of_one_color_have_its_weights(count):
    colors = np.tile(np.float32([[0.4, 0.2, 0.1]]), (count, 1))
    places = np.random.default_rng(2).random((count, 2))
    np.testing.assert_allclose(loco_weights(colors, places, PALETTE), star_weights(colors, PALETTE), atol=1e-6)
