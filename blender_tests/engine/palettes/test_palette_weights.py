"""Star weights with and without scipy, and the weights of LoCoPalettes."""

import numpy as np
import pytest

from blender_tests.engine.palettes.conftest import LEGO
from karf_engine.palettes.palette_weights import (
    hull_corners,
    loco_weights,
    outside_distance,
    palette_weights_of_image,
    star_weights,
)
from karf_engine.palettes.star import plain_hull, star_of, star_weights_in

PALETTES = {
    "six": LEGO,
    "cube": np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float),
    "tetrahedron": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    "one inside": np.array([[0, 0, 0], [1, 0.1, 0], [0.2, 1, 0], [0, 0, 1], [0.2, 0.2, 0.2]]),
    "flat triangle": np.array([[0, 0, 0], [0.9, 0.2, 0.1], [0.1, 0.3, 0.8]]),
    "flat quad": np.array([[0, 0, 0], [0.5, 0.1, 0.1], [0.6, 0.3, 0.6], [0.1, 0.2, 0.5]]),
    "single hue": np.array([[0, 0, 0], [0.8, 0.2, 0.1]]),
    "single hue twice": np.array([[0, 0, 0], [0.4, 0.1, 0.05], [0.8, 0.2, 0.1]]),
    "line": np.array([[0, 0, 0], [0.5, 0.5, 0.5], [1, 1, 1]]),
    "black alone": np.zeros((1, 3)),
    "all black": np.zeros((2, 3)),
    "twins": np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
}
COLORS = np.random.default_rng(2).random((2000, 3))
PALETTE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [1, 1, 0]], np.float32)


@pytest.fixture(params=PALETTES.values(), ids=PALETTES.keys())
def palette(request):
    return request.param


def test_weights_are_sparse_sum_to_one_and_are_exact_inside(palette):
    random = np.random.default_rng(0)
    weights = star_weights(random.random((2000, 3)), palette)
    assert weights.shape == (2000, len(palette)) and weights.dtype == np.float32
    assert weights.min() >= 0 and (weights > 0).sum(axis=1).max() <= 4
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=5e-7)
    inside = random.dirichlet(np.full(len(palette), 0.5), 2000) @ palette
    np.testing.assert_allclose(star_weights(inside, palette) @ palette, inside, atol=1e-6)
    assert outside_distance(inside, palette).max() < 1e-7


def test_hull_corners_and_black_use_their_own_entry_alone(palette):
    np.testing.assert_array_equal(star_weights(np.zeros((1, 3)), palette)[0], np.eye(len(palette))[0])
    np.testing.assert_allclose(star_weights(LEGO, LEGO), np.eye(6), atol=1e-6)


def test_outside_colors_project_to_the_hull_and_weights_are_continuous(palette):
    random = np.random.default_rng(2)
    colors = random.random((300, 3))
    nearest = star_weights(colors, palette) @ palette
    distance = np.linalg.norm(colors - nearest, axis=1)
    np.testing.assert_allclose(outside_distance(colors, palette), distance, atol=1e-6)
    # the nearest point of a convex set: no other point lies on the color's side of it
    others = np.vstack([palette, random.dirichlet(np.ones(len(palette)), 200) @ palette])
    along = (others @ (colors - nearest).T) - (nearest * (colors - nearest)).sum(axis=1)
    assert along.max() < 1e-5
    colors, step = random.random((4000, 3)), 1e-6 * random.normal(size=(4000, 3))
    change = np.abs(star_weights(colors + step, palette) - star_weights(colors, palette)).max()
    assert change < 5e-4  # the steepest cone of these palettes multiplies a step by less than 100


def test_image_weights_equal_weights_of_its_pixels():
    image = np.random.default_rng(6).integers(0, 4, (20, 30, 3)).astype(np.uint8) * np.uint8(80)
    expected = star_weights(image.reshape(-1, 3) / 255, LEGO).reshape(20, 30, 6)
    np.testing.assert_array_equal(palette_weights_of_image(image, LEGO), expected)
    assert star_weights(np.zeros((0, 3)), LEGO).shape == (0, 6)


@pytest.mark.parametrize("size", [2, 3, 4, 6, 12, 30])
def test_plain_hull_gives_the_weights_of_scipy(size):
    palette = np.concatenate([np.zeros((1, 3)), np.random.default_rng(size).random((size - 1, 3))])
    found = star_weights_in(star_of(palette, plain_hull), COLORS, size)
    np.testing.assert_allclose(found, star_weights(COLORS, palette), atol=1e-5)


@pytest.mark.parametrize("name", ["line", "flat quad", "cube", "all black", "twins"])
def test_plain_hull_of_degenerate_palettes_mixes_the_same_colors(name):
    palette = PALETTES[name]
    found = star_weights_in(star_of(palette, plain_hull), COLORS, len(palette))
    np.testing.assert_allclose(found @ palette, star_weights(COLORS, palette) @ palette, atol=1e-5)
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-5)
    assert (found >= 0).all()


@pytest.fixture
def pixels():
    """Colors inside the palette's hull that vary with the place, and the places in the unit square."""
    random = np.random.default_rng(0)
    places = random.random((600, 2))
    colors = 0.3 * np.stack([places[:, 0], places[:, 1], 1 - places[:, 0]], 1) + 0.1 * random.random((600, 3))
    return colors, places


def test_loco_weights_mix_the_weights_of_corners(pixels):
    colors, places = pixels
    weights, direct = loco_weights(colors, places, PALETTE), star_weights(colors, PALETTE)
    assert weights.shape == (600, 6) and weights.dtype == np.float32 and weights.min() >= 0
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    np.testing.assert_allclose(weights @ PALETTE, colors, atol=1e-5)
    corners = hull_corners(np.concatenate([colors, places], 1))
    assert 20 < len(corners) < 600
    np.testing.assert_allclose(weights[corners], direct[corners], atol=1e-5)
    others = np.setdiff1d(np.arange(600), corners)
    assert np.abs(weights[others] - direct[others]).max() > 0.01


def test_pixel_with_outlying_features_becomes_a_corner(pixels):
    colors, places = pixels
    corners = hull_corners(np.concatenate([colors, places], 1))
    inner = int(np.setdiff1d(np.arange(600), corners)[0])
    features = np.random.default_rng(1).normal(size=(600, 8))
    features[inner] = 50
    direct = star_weights(colors, PALETTE)[inner]
    assert np.abs(loco_weights(colors, places, PALETTE)[inner] - direct).max() > 1e-4
    np.testing.assert_allclose(loco_weights(colors, places, PALETTE, features)[inner], direct, atol=1e-5)


@pytest.mark.parametrize("count", [1, 5, 50])
def test_loco_weights_of_one_color_are_its_own(count):
    colors = np.tile(np.float32([[0.4, 0.2, 0.1]]), (count, 1))
    places = np.random.default_rng(2).random((count, 2))
    np.testing.assert_allclose(loco_weights(colors, places, PALETTE), star_weights(colors, PALETTE), atol=1e-6)
