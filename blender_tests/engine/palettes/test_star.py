"""Hulls without scipy: the same stars, and so the same weights, as with it."""

import numpy as np
import pytest

from karf_engine.palettes.star import plain_hull, star_of, star_weights_in

star_weights = pytest.importorskip("karf_engine.palettes.extraction.barycentric_weights").star_weights
COLORS = np.random.default_rng(2).random((2000, 3))


@pytest.mark.parametrize("size", [2, 3, 4, 6, 12, 30])
def test_weights_are_those_of_the_engine(size):
    palette = np.concatenate([np.zeros((1, 3)), np.random.default_rng(size).random((size - 1, 3))])
    found = star_weights_in(star_of(palette, plain_hull), COLORS, size)
    np.testing.assert_allclose(found, star_weights(COLORS, palette), atol=1e-5)


@pytest.mark.parametrize(
    "palette",
    [
        [[0, 0, 0], [0.5, 0.5, 0.5], [1, 1, 1]],  # a line
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0.9, 0.2, 0], [0.2, 0.1, 0]],  # a plane
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],  # faces of four
        [[0, 0, 0], [0, 0, 0]],
    ],
)
def test_flat_palettes_and_faces_of_more_corners_mix_the_same_colors(palette):
    palette = np.array(palette, float)
    found = star_weights_in(star_of(palette, plain_hull), COLORS, len(palette))
    np.testing.assert_allclose(found @ palette, star_weights(COLORS, palette) @ palette, atol=1e-5)
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-5)
    assert (found >= 0).all()
