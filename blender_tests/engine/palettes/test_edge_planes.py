"""Planes of objects whose edges were moved and faded: what keeps its weights, and what gets which."""

import numpy as np
import pytest

from karf_engine.palettes.added import split_weights
from karf_engine.palettes.compositing import Planes, delta_composite, stack_palettes
from karf_engine.palettes.edge_planes import ObjectEdge, apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape
from karf_engine.palettes.palette import AddedColor, Palette
from karf_engine.palettes.swatch_picture import ObjectPlanes, delta_picture

RED, GRAY, BLUE = np.array([0.8, 0.2, 0.2]), np.array([0.5, 0.5, 0.5]), np.array([0.2, 0.2, 0.8])
POT = Palette("pot", np.array([[0, 0, 0], RED, [0.9, 0.9, 0.9]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], BLUE, [1, 1, 1]], np.float32))
SIDE = 40


def scene(base=GRAY):
    """A red pot with soft edges on a ground, a blue mug right beside it: base, weights, probabilities."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    pot = np.clip(10.5 - np.hypot(rows - 20, columns - 14), 0, 1)
    mug = np.where(columns >= 28, 1.0, 0.0)
    coverage = np.stack([pot, mug]).astype(np.float32)
    weights = np.zeros((2, 3, SIDE, SIDE), np.float32)
    weights[:, 1] = coverage
    picture = np.broadcast_to(base, (SIDE, SIDE, 3)).copy()
    for own, part in ((RED, pot), (BLUE, mug)):
        picture = part[..., None] * own + (1 - part[..., None]) * picture
    return picture, weights, coverage


def shape_pot(shape, scene, scale=1.0):
    return apply_edges_to_planes(*scene, [POT, MUG], {"pot": shape}, scale)


def test_without_edges_the_same_arrays_come_back():
    base, weights, coverage = scene()
    for edges in ({}, {"pot": EdgeShape()}):
        again = apply_edges_to_planes(base, weights, coverage, [POT, MUG], edges, 1.0)
        assert again[0] is weights and again[1] is coverage


def test_where_less_is_covered_weights_shrink_along():
    base, weights, coverage = scene()
    after, covered = shape_pot(EdgeShape(choke=2), (base, weights, coverage))
    np.testing.assert_allclose(after[0, 1], covered[0], atol=1e-6)
    np.testing.assert_array_equal(after[1], weights[1])
    np.testing.assert_array_equal(covered[1], coverage[1])
    deep = covered[0] == 1
    np.testing.assert_array_equal(after[0][:, deep], weights[0][:, deep])


def test_weights_add_up_to_what_is_covered():
    for shape in (EdgeShape(-3), EdgeShape(feather=6), EdgeShape(-2, 8), EdgeShape(1, 3)):
        after, covered = shape_pot(shape, scene())
        np.testing.assert_allclose(after[0].sum(axis=0), covered[0], atol=1e-5)
        assert (after >= 0).all() and (covered.sum(axis=0) <= 1 + 1e-5).all()


def test_a_rim_that_was_missed_is_recolored_and_the_ground_keeps_its_gray():
    base, weights, coverage = scene(base=GRAY)
    missed = (coverage[0] > 0) & (coverage[0] < 1)
    missed |= np.hypot(*(np.mgrid[:SIDE, :SIDE] - np.array([20, 14])[:, None, None])) < 11.5
    missed &= coverage[0] < 1
    base[missed] = RED  # the pot goes on where nothing is covered
    edited = stack_palettes(["pot", "mug"], {"pot": POT.colors[[0, 1, 2]].copy(), "mug": MUG.colors})
    edited[0, 1] = [0.1, 0.6, 0.1]
    learned = stack_palettes(["pot", "mug"], {"pot": POT.colors, "mug": MUG.colors})
    after, _ = shape_pot(EdgeShape(choke=-4), (base, weights, coverage))
    picture = delta_composite(base.astype(np.float32), after, learned, edited)
    ring = missed & (picture[..., 0] < 0.15)
    assert ring.sum() > 0.9 * missed.sum()
    ground = (coverage.sum(axis=0) == 0) & ~missed
    # a gray is white and black to this palette: none of its red is in there
    np.testing.assert_allclose(picture[ground], base[ground], atol=1e-6)


def test_the_mug_beside_it_is_not_painted():
    after, covered = shape_pot(EdgeShape(-8, 10), scene())
    mug = scene()[2][1] == 1
    assert not covered[0][mug].any() and not after[0][:, mug].any()


@pytest.mark.parametrize("as_bytes", [True, False])
@pytest.mark.parametrize("colors_move", [True, False])
def test_a_picture_that_follows_is_the_one_that_is_composed_anew(as_bytes, colors_move):
    base, weights, coverage = scene()
    stored = np.rint(255 * base).astype(np.uint8)
    planes = Planes(("pot", "mug"), weights.astype(np.float16), coverage.astype(np.float16), stored)
    used = stored if as_bytes else stored.astype(np.float32) / 255
    picture = delta_picture(planes, np.empty((SIDE, SIDE, 3), np.float32))
    factors = np.zeros((2, 3, 3), np.float32)
    factors[0, 1], factors[1, 1] = [-0.6, 0.3, 0.5], [0.3, 0, -0.4]
    picture.paint(factors)
    kept = planes.palette_weights.astype(np.float32), planes.probabilities.astype(np.float32)
    room = 1 - kept[1][1]
    edge = ObjectEdge(used, kept[0][0], kept[1][0], room, POT.colors, 1.0)
    shapes = [EdgeShape(-3), EdgeShape(2), EdgeShape(feather=9), EdgeShape(-1, 4), EdgeShape(-1, 7), EdgeShape()]
    for shape in shapes:
        _, pixels, changed = edge.shaped(shape)
        if shape is shapes[0]:
            picture.reshape(0, ObjectPlanes(*((each.start, each.stop) for each in edge.place), edge.weights))
        else:
            picture.retouch(0, pixels, changed)
        factors[0, 1, 0] += 0.01 * colors_move
        live = picture.paint(factors)
        after, _ = apply_edges_to_planes(used, *kept, [POT, MUG], {"pot": shape}, 1.0)
        anew = delta_composite(stored.astype(np.float32) / 255, after, np.zeros_like(factors), factors)
        np.testing.assert_allclose(live, anew, atol=1e-6)
        factors[0, 2, 1] += 0.02 * colors_move  # another color moves alone, so that the next shape begins anew
        picture.paint(factors)


def test_weights_are_spread_over_the_sets_of_added_colors_whatever_the_edge():
    base, weights, coverage = scene()
    added = [AddedColor(np.array([0.7, 0.3, 0.3], np.float32), 0.3), AddedColor(GRAY.astype(np.float32), 0.5)]
    shown = base, weights[0], coverage[0], 1 - coverage[1], POT.colors, 1.0
    plain, with_sets = ObjectEdge(*shown), ObjectEdge(*shown, added)
    for shape in (EdgeShape(-3), EdgeShape(2, 5), EdgeShape(-1, 9), EdgeShape()):
        for edge in (plain, with_sets):
            edge.shaped(shape)
        np.testing.assert_allclose(with_sets.weights, split_weights(plain.weights, POT.colors, added), atol=1e-5)
    assert with_sets.weights[3:].any()


def test_an_object_that_is_nowhere_stays_nowhere():
    base, weights, coverage = scene()
    weights[0], coverage[0] = 0, 0
    after, covered = shape_pot(EdgeShape(-5, 20), (base, weights, coverage))
    assert not after[0].any() and not covered[0].any()
