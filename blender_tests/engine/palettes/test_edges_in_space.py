"""Edges on points in space: they move by lengths, fade as in pictures, and leave all else alone."""

import numpy as np
import pytest

from karf_engine.palettes.edge_shape import Borders, EdgeShape, apply_edges_to_points, feather

SPACING, PIXEL = 0.1, 0.5
PLACES = np.arange(-20, 20, SPACING) + SPACING / 2  # across a straight border


def shares_of(shape, others=0.0):
    """The shares of points along PLACES, of which those over 0 are the pot's; `others`: the mug's share of those below."""
    shares = np.stack([PLACES > 0, others * (PLACES < 0)], 1).astype(np.float32)
    distances = np.stack([PLACES, np.full_like(PLACES, -np.inf)], 1).astype(np.float32)
    borders = Borders(distances, np.full(2, SPACING, np.float32), np.full(2, PIXEL, np.float32))
    return shares, apply_edges_to_points(shares, borders, ["pot", "mug"], {"pot": shape})


def test_without_a_shape_no_bit_changes():
    before, after = shares_of(EdgeShape(), others=0.3)
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize("choke", [-16, -3, -0.5, 0.5, 3, 16])
def test_a_border_moves_by_as_many_pixels_times_what_one_spans(choke):
    _, after = shares_of(EdgeShape(choke=choke))
    assert PLACES[after[:, 0] > 0.5].min() == pytest.approx(choke * PIXEL, abs=1.01 * SPACING)


@pytest.mark.parametrize("choke", [-4, 0, 4])
def test_it_fades_along_the_profile_of_pictures(choke):
    _, after = shares_of(EdgeShape(choke, 20))
    row = (choke * PIXEL < PLACES).astype(np.float32)
    wanted = feather(np.tile(row, (3, 1)), 20 * PIXEL / SPACING)[1]
    np.testing.assert_allclose(after[:, 0], wanted, atol=0.02)


def test_it_does_not_spread_into_another_object():
    before, after = shares_of(EdgeShape(choke=-8), others=0.75)
    assert after.sum(1).max() <= 1 + 1e-6 and after[PLACES < 0, 0].max() == pytest.approx(0.25)
    np.testing.assert_array_equal(after[:, 1], before[:, 1])


def test_less_than_a_spacing_changes_little():
    before, after = shares_of(EdgeShape(feather=0.01))
    np.testing.assert_allclose(after, before, atol=1e-6)
