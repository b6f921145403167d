"""Edges that are moved and faded: by how much, in every direction, and nothing where nothing is asked for."""

from itertools import pairwise
from math import cos, radians, sin

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from karf_engine.errors import BadRequest
from karf_engine.palettes import edge_shape
from karf_engine.palettes.edge_shape import EdgeShape, apply_edge_shape, erode, feather

SIDE = 120
MIDDLE = slice(40, 80)


def straight_edge(degrees=0.0, softness=1.0):
    """The object right of a straight edge through the middle, which is turned, [H, W]."""
    rows, columns = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    along = columns * cos(radians(degrees)) + rows * sin(radians(degrees))
    return np.clip(along / softness + 0.5, 0, 1).astype(np.float32)


def disk(radius, softness=1.0, side=SIDE):
    rows, columns = np.mgrid[:side, :side] - (side - 1) / 2
    return np.clip((radius - np.hypot(rows, columns)) / softness + 0.5, 0, 1).astype(np.float32)


def shift(before, after, degrees):
    """By how many pixels a straight edge has moved into the object."""
    steep = abs(sin(radians(degrees))) > abs(cos(radians(degrees)))
    lost = (before - after).sum(axis=0 if steep else 1)[MIDDLE].mean()
    return lost * max(abs(sin(radians(degrees))), abs(cos(radians(degrees))))


def test_a_neutral_shape_gives_the_same_bits():
    soft = np.random.default_rng(0).random((30, 40)).astype(np.float32)
    np.testing.assert_array_equal(apply_edge_shape(soft, EdgeShape()), soft)
    half = soft.astype(np.float16)
    np.testing.assert_array_equal(apply_edge_shape(half, EdgeShape(), scale=0.3).astype(np.float16), half)


@pytest.mark.parametrize("degrees", range(0, 91, 9))
@pytest.mark.parametrize("choke", [0.5, 1, 1.7, 3, 8, -0.5, -2, -5])
def test_an_edge_moves_by_its_choke_in_every_direction(degrees, choke):
    before = straight_edge(degrees)
    assert shift(before, erode(before, choke), degrees) == pytest.approx(choke, abs=0.12)


@pytest.mark.parametrize("degrees", [0, 30, 45, 90])
def test_a_soft_edge_stays_as_soft_as_it_was(degrees):
    def steepest(coverage):
        return np.hypot(*np.gradient(coverage))[MIDDLE, MIDDLE].max()

    before = straight_edge(degrees, softness=6)
    for choke in (1.5, -3):
        assert steepest(erode(before, choke)) == pytest.approx(steepest(before), rel=0.03)


@pytest.mark.parametrize("distance", [0.4, 1, 1.7, 3.2])
def test_a_moved_edge_is_the_least_of_a_disk_and_of_points_on_its_rim(distance):
    soft = np.random.default_rng(2).random((30, 40)).astype(np.float32)
    soft[8:20, 10:28] = 1
    pixels = np.argwhere(np.hypot(*np.mgrid[-4:5, -4:5]) <= distance) - 4
    turns = np.arange(edge_shape.DIRECTIONS) * 2 * np.pi / edge_shape.DIRECTIONS
    rim = distance * np.stack([np.sin(turns), np.cos(turns)], axis=1)
    places = np.mgrid[:30, :40]
    seen = [
        map_coordinates(soft, places + offset[:, None, None], order=1, mode="nearest") for offset in (*pixels, *rim)
    ]
    np.testing.assert_allclose(erode(soft, distance), np.min(seen, axis=0), atol=1e-5)


def test_whole_pixels_keep_a_hard_edge_hard():
    hard = (straight_edge() > 0.5).astype(np.float32)
    np.testing.assert_array_equal(erode(hard, 2)[:, 2:], hard[:, :-2])
    np.testing.assert_array_equal(erode(hard, -2)[:, :-2], hard[:, 2:])


def test_more_choke_never_covers_more():
    soft = disk(40, 5) * np.random.default_rng(1).random((SIDE, SIDE)).astype(np.float32)
    for width in (0, 7):
        steps = [
            apply_edge_shape(soft, EdgeShape(choke, width)) for choke in (-6, -2.5, -1, -0.3, 0, 0.4, 1, 2, 5.5, 16)
        ]
        for wider, narrower in pairwise(steps):
            assert (narrower <= wider + 1e-5).all()


def test_shrinking_covers_nothing_new_and_growing_loses_nothing():
    soft = disk(40, 3)
    assert (apply_edge_shape(soft, EdgeShape(choke=2)) <= soft).all()
    assert (apply_edge_shape(soft, EdgeShape(choke=-2)) >= soft - 1e-6).all()


@pytest.mark.parametrize("degrees", [0, 20, 45, 90])
@pytest.mark.parametrize("feather", [0.7, 2, 5, 12, 40])
def test_a_straight_edge_keeps_its_half_where_it_was(degrees, feather):
    before = straight_edge(degrees)
    after = apply_edge_shape(before, EdgeShape(feather=feather))
    assert shift(before, after, degrees) == pytest.approx(0, abs=0.02)
    np.testing.assert_allclose((after + after[::-1, ::-1])[MIDDLE, MIDDLE], 1, atol=1e-5)  # alike on either side


@pytest.mark.parametrize("width", [4, 12, 40])
def test_an_edge_fades_over_its_feather_and_no_further(width):
    row = feather((straight_edge() > 0.5).astype(np.float32), width)[SIDE // 2]
    changing = np.flatnonzero((row > 1e-3) & (row < 1 - 1e-3))
    assert width * 0.75 - 2 <= len(changing) <= width + 2
    assert (np.diff(row) >= -1e-6).all()


def test_a_fade_is_wider_where_more_feather_is_asked_for():
    widths = [np.sum((row := feather(straight_edge(), width)[60]) * (1 - row)) for width in (0.5, 1, 2, 4, 8, 16, 64)]
    assert (np.diff(widths) > 0).all()


def test_a_picture_of_half_the_size_takes_half_the_pixels():
    fine = disk(80, 2, side=240)
    coarse = fine.reshape(120, 2, 120, 2).mean(axis=(1, 3))
    for shape in (EdgeShape(choke=4), EdgeShape(choke=-3, feather=10), EdgeShape(feather=16)):
        halved = apply_edge_shape(fine, shape).reshape(120, 2, 120, 2).mean(axis=(1, 3))
        assert np.abs(apply_edge_shape(coarse, shape, scale=0.5) - halved).max() < 0.16
        assert np.abs(apply_edge_shape(coarse, shape, scale=0.5) - halved).mean() < 0.004


def test_at_the_border_of_the_picture_an_object_goes_on():
    half = np.zeros((20, 20), np.float32)
    half[:, :10] = 1
    for shape in (EdgeShape(choke=3), EdgeShape(feather=8)):
        after = apply_edge_shape(half, shape)
        np.testing.assert_allclose(after, np.broadcast_to(after[10], after.shape), atol=1e-6)
        assert after[0, 0] == 1


def test_blocks_leave_no_seams(monkeypatch):
    soft = disk(55, 4) * (disk(20) < 0.5)
    shape = EdgeShape(-2.3, 9)
    whole = apply_edge_shape(soft, shape)
    monkeypatch.setattr(edge_shape, "BLOCK", 17)
    np.testing.assert_allclose(apply_edge_shape(soft, shape), whole, atol=1e-6)


def test_no_edge_spreads_into_what_is_anothers():
    object_, other = straight_edge() > 0.5, straight_edge(180) > 0.5
    room = 1 - other.astype(np.float32)
    for shape in (EdgeShape(choke=-4), EdgeShape(feather=10), EdgeShape(-3, 10)):
        assert not apply_edge_shape(object_, shape, room=room)[other].any()
    nobodys = apply_edge_shape(object_, EdgeShape(choke=-4), room=np.ones_like(room))
    assert nobodys[other].any()


def test_nothing_stays_nothing():
    assert not apply_edge_shape(np.zeros((5, 7)), EdgeShape(-16, 64)).any()
    assert apply_edge_shape(np.zeros((0, 0)), EdgeShape(1, 1)).shape == (0, 0)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"choke": 16.5}, BadRequest),
        ({"choke": float("nan")}, BadRequest),
        ({"feather": -1}, BadRequest),
        ({"feather": 65.0}, BadRequest),
        ({"choke": "2"}, TypeError),
        ({"feather": None}, TypeError),
    ],
)
def test_a_shape_that_cannot_be_is_refused(wrong, error):
    with pytest.raises(error, match=next(iter(wrong))):
        EdgeShape(**wrong)
