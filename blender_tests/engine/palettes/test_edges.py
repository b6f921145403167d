"""Moved and faded edges in pictures, in the planes of objects, and on points in space."""

from itertools import pairwise
from math import cos, radians, sin

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from karf_engine.errors import BadRequest
from karf_engine.palettes import edge_shape
from karf_engine.palettes.added import split_weights
from karf_engine.palettes.compositing import Planes, delta_composite, stack_palettes
from karf_engine.palettes.edge_planes import ObjectEdge, apply_edges_to_planes
from karf_engine.palettes.edge_shape import Borders, EdgeShape, apply_edge_shape, apply_edges_to_points, erode, feather
from karf_engine.palettes.palette import AddedColor, Palette
from karf_engine.palettes.swatch_picture import ObjectPlanes, delta_picture

SIDE = 120
MIDDLE = slice(40, 80)
SHAPES = [EdgeShape(choke=2), EdgeShape(choke=-3), EdgeShape(feather=8), EdgeShape(-2, 9), EdgeShape(1, 3)]
RED, GRAY, BLUE = np.array([0.8, 0.2, 0.2]), np.array([0.5, 0.5, 0.5]), np.array([0.2, 0.2, 0.8])
POT = Palette("pot", np.array([[0, 0, 0], RED, [0.9, 0.9, 0.9]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], BLUE, [1, 1, 1]], np.float32))
ROWS, COLUMNS = np.mgrid[:40, :40]
RADIUS = np.hypot(ROWS - 20, COLUMNS - 14)  # from the middle of the pot
SPACING, PIXEL = 0.1, 0.5
PLACES = np.arange(-20, 20, SPACING) + SPACING / 2  # across a straight border


def straight_edge(degrees=0.0, softness=1.0):
    """Coverage right of a turned straight edge through the middle, [H, W]."""
    rows, columns = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    along = columns * cos(radians(degrees)) + rows * sin(radians(degrees))
    return np.clip(along / softness + 0.5, 0, 1).astype(np.float32)


def disk(radius, softness=1.0, side=SIDE):
    rows, columns = np.mgrid[:side, :side] - (side - 1) / 2
    return np.clip((radius - np.hypot(rows, columns)) / softness + 0.5, 0, 1).astype(np.float32)


def shift(before, after, degrees):
    """Return how many pixels a straight edge has moved into the object."""
    sine, cosine = abs(sin(radians(degrees))), abs(cos(radians(degrees)))
    return (before - after).sum(axis=0 if sine > cosine else 1)[MIDDLE].mean() * max(sine, cosine)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_neutral_shape_keeps_every_bit(kind):
    soft = np.random.default_rng(0).random((30, 40)).astype(kind)
    np.testing.assert_array_equal(apply_edge_shape(soft, EdgeShape(), scale=0.3).astype(kind), soft)


@pytest.mark.parametrize("degrees", range(0, 91, 18))
@pytest.mark.parametrize("choke", [0.5, 1, 1.7, 3, 8, -0.5, -2, -5])
def test_choke_moves_an_edge_in_every_direction(degrees, choke):
    before = straight_edge(degrees)
    assert shift(before, erode(before, choke), degrees) == pytest.approx(choke, abs=0.12)


@pytest.mark.parametrize("distance", [0.4, 1, 1.7, 3.2])
def test_erosion_is_the_minimum_over_a_disk_and_its_rim(distance):
    soft = np.random.default_rng(2).random((30, 40)).astype(np.float32)
    soft[8:20, 10:28] = 1
    pixels = np.argwhere(np.hypot(*np.mgrid[-4:5, -4:5]) <= distance) - 4
    turns = np.arange(edge_shape.DIRECTIONS) * 2 * np.pi / edge_shape.DIRECTIONS
    rim = distance * np.stack([np.sin(turns), np.cos(turns)], axis=1)
    places = np.mgrid[:30, :40]
    offsets = np.concatenate([pixels, rim])[:, :, None, None]
    found = [map_coordinates(soft, places + offset, order=1, mode="nearest") for offset in offsets]
    np.testing.assert_allclose(erode(soft, distance), np.min(found, axis=0), atol=1e-5)


def test_growth_shrinks_the_rest_and_whole_pixels_keep_edges_hard():
    soft = np.random.default_rng(3).random((30, 40)).astype(np.float32)
    np.testing.assert_allclose(erode(soft, -1.7), 1 - erode(1 - soft, 1.7), atol=1e-6)
    hard = (straight_edge() > 0.5).astype(np.float32)
    np.testing.assert_array_equal(erode(hard, 2)[:, 2:], hard[:, :-2])


@pytest.mark.parametrize("width", [0, 7])
def test_more_choke_never_covers_more(width):
    soft = disk(40, 5) * np.random.default_rng(1).random((SIDE, SIDE)).astype(np.float32)
    chokes = (-6, -2.5, -1, -0.3, 0, 0.4, 1, 2, 5.5, 16)
    for wider, narrower in pairwise(apply_edge_shape(soft, EdgeShape(choke, width)) for choke in chokes):
        assert (narrower <= wider + 1e-5).all()


@pytest.mark.parametrize("degrees", [0, 20, 45, 90])
@pytest.mark.parametrize("width", [0.7, 2, 5, 12, 40])
def test_feather_fades_an_edge_symmetrically(degrees, width):
    before = straight_edge(degrees)
    after = apply_edge_shape(before, EdgeShape(feather=width))
    assert shift(before, after, degrees) == pytest.approx(0, abs=0.02)
    np.testing.assert_allclose((after + after[::-1, ::-1])[MIDDLE, MIDDLE], 1, atol=1e-5)
    if degrees == 0:
        row = feather((before > 0.5).astype(np.float32), width)[SIDE // 2]
        assert width * 0.75 - 2 <= np.sum((row > 1e-3) & (row < 1 - 1e-3)) <= width + 2
        assert (np.diff(row) >= -1e-6).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_blocks_leave_no_seams_and_scale_matches_a_halved_picture(shape, monkeypatch):
    fine = disk(80, 2, side=240)
    coarse, halved = (each.reshape(120, 2, 120, 2).mean(axis=(1, 3)) for each in (fine, apply_edge_shape(fine, shape)))
    small = apply_edge_shape(coarse, shape, scale=0.5)
    assert np.abs(small - halved).max() < 0.16 and np.abs(small - halved).mean() < 0.004
    monkeypatch.setattr(edge_shape, "BLOCK", 17)
    np.testing.assert_allclose(apply_edge_shape(coarse, shape, scale=0.5), small, atol=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_object_continues_past_the_border_but_not_into_others(shape):
    object_, other = straight_edge() > 0.5, straight_edge(180) > 0.5
    after = apply_edge_shape(object_, shape)
    np.testing.assert_allclose(after, np.broadcast_to(after[60], after.shape), atol=1e-6)
    assert after[0, -1] == 1 and (shape.choke >= 0 or after[other].any())
    assert not apply_edge_shape(object_, shape, room=1 - other.astype(np.float32))[other].any()


@pytest.mark.parametrize(("name", "value"), [("choke", np.nan), ("choke", 16.5), ("feather", -1), ("feather", "2")])
def test_invalid_shapes_are_rejected(name, value):
    with pytest.raises(TypeError if value == "2" else BadRequest, match=name):
        EdgeShape(**{name: value})


@pytest.fixture
def scene():
    """A red pot with soft edges on a ground, a blue mug right beside it: base, weights, coverage."""
    coverage = np.stack([np.clip(10.5 - RADIUS, 0, 1), COLUMNS >= 28]).astype(np.float32)
    weights = np.zeros((2, 3, 40, 40), np.float32)
    weights[:, 1] = coverage
    picture = np.einsum("khw,kc->hwc", coverage, [RED, BLUE]) + (1 - coverage.sum(0))[..., None] * GRAY
    return picture, weights, coverage


def shape_pot(scene, shape):
    return apply_edges_to_planes(*scene, [POT, MUG], {"pot": shape}, 1.0)


@pytest.mark.parametrize("edges", [{}, {"pot": EdgeShape()}])
def test_planes_without_edges_are_returned_unchanged(scene, edges):
    weights, coverage = apply_edges_to_planes(*scene, [POT, MUG], edges, 1.0)
    assert weights is scene[1] and coverage is scene[2]


@pytest.mark.parametrize("shape", SHAPES)
def test_weights_sum_to_coverage_and_other_objects_keep_theirs(scene, shape):
    _, weights, coverage = scene
    after, covered = shape_pot(scene, shape)
    np.testing.assert_allclose(after[0].sum(axis=0), covered[0], atol=1e-5)
    assert (after >= 0).all() and (covered.sum(axis=0) <= 1 + 1e-5).all()
    np.testing.assert_array_equal(after[1], weights[1])
    np.testing.assert_array_equal(covered[1], coverage[1])
    assert not covered[0][coverage[1] == 1].any() and not after[0][:, coverage[1] == 1].any()
    if shape.choke > 0 and not shape.feather:
        np.testing.assert_allclose(after[0, 1], covered[0], atol=1e-6)
    deep = (covered[0] == 1) & (coverage[0] == 1)
    assert deep.any()
    np.testing.assert_array_equal(after[0][:, deep], weights[0][:, deep])


def test_growth_recolors_a_missed_rim_and_not_the_ground(scene):
    base, _, coverage = scene
    missed = (RADIUS < 11.5) & (coverage[0] < 1)
    base[missed] = RED  # the pot continues where its coverage ends
    learned = stack_palettes(["pot", "mug"], {"pot": POT.colors, "mug": MUG.colors})
    edited = learned.copy()
    edited[0, 1] = [0.1, 0.6, 0.1]
    after, _ = shape_pot(scene, EdgeShape(choke=-4))
    picture = delta_composite(base.astype(np.float32), after, learned, edited)
    assert (missed & (picture[..., 0] < 0.15)).sum() > 0.9 * missed.sum()
    ground = (coverage.sum(axis=0) == 0) & ~missed
    # to this palette, gray is white and black without any red
    np.testing.assert_allclose(picture[ground], base[ground], atol=1e-6)


@pytest.mark.parametrize("as_bytes", [True, False])
@pytest.mark.parametrize("colors_move", [True, False])
def test_live_picture_equals_a_new_composite(scene, as_bytes, colors_move):
    base, weights, coverage = scene
    stored = np.rint(255 * base).astype(np.uint8)
    planes = Planes(("pot", "mug"), weights.astype(np.float16), coverage.astype(np.float16), stored)
    used = stored if as_bytes else stored.astype(np.float32) / 255
    picture = delta_picture(planes, np.empty((40, 40, 3), np.float32))
    factors = np.zeros((2, 3, 3), np.float32)
    factors[0, 1], factors[1, 1] = [-0.6, 0.3, 0.5], [0.3, 0, -0.4]
    picture.paint(factors)
    weights, coverage = planes.palette_weights.astype(np.float32), planes.probabilities.astype(np.float32)
    edge = ObjectEdge(used, weights[0], coverage[0], 1 - coverage[1], POT.colors, 1.0)
    shapes = [EdgeShape(-3), EdgeShape(2), EdgeShape(feather=9), EdgeShape(-1, 4), EdgeShape(-1, 7), EdgeShape()]
    for shape in shapes:
        _, pixels, changed = edge.shaped(shape)
        if shape is shapes[0]:
            picture.reshape(0, ObjectPlanes(*((each.start, each.stop) for each in edge.place), edge.weights))
        else:
            picture.retouch(0, pixels, changed)
        factors[0, 1, 0] += 0.01 * colors_move
        live = picture.paint(factors)
        after, _ = shape_pot((used, weights, coverage), shape)
        anew = delta_composite(stored.astype(np.float32) / 255, after, np.zeros_like(factors), factors)
        np.testing.assert_allclose(live, anew, atol=1e-6)
        factors[0, 2, 1] += 0.02 * colors_move  # another color moves, and the next shape starts from a new picture
        picture.paint(factors)


def test_weights_split_over_added_colors_for_every_edge(scene):
    base, weights, coverage = scene
    added = [AddedColor(np.array([0.7, 0.3, 0.3], np.float32), 0.3), AddedColor(GRAY.astype(np.float32), 0.5)]
    shown = base, weights[0], coverage[0], 1 - coverage[1], POT.colors, 1.0
    plain, with_sets = ObjectEdge(*shown), ObjectEdge(*shown, added)
    for shape in (*SHAPES, EdgeShape()):
        for edge in (plain, with_sets):
            edge.shaped(shape)
        np.testing.assert_allclose(with_sets.weights, split_weights(plain.weights, POT.colors, added), atol=1e-5)
    assert with_sets.weights[3:].any()


def test_empty_coverage_stays_empty(scene):
    assert not apply_edge_shape(np.zeros((5, 7)), EdgeShape(-16, 64)).any()
    assert apply_edge_shape(np.zeros((0, 0)), EdgeShape(1, 1)).shape == (0, 0)
    for planes in scene[1:]:
        planes[0] = 0
    after, covered = shape_pot(scene, EdgeShape(-5, 20))
    assert not after[0].any() and not covered[0].any()


def shape_points(shape, others=0.0):
    """Shares before and after of points along PLACES: the pot's above 0; the mug has the share `others` below."""
    shares = np.stack([PLACES > 0, others * (PLACES < 0)], 1).astype(np.float32)
    distances = np.stack([PLACES, np.full_like(PLACES, -np.inf)], 1).astype(np.float32)
    borders = Borders(distances, np.full(2, SPACING, np.float32), np.full(2, PIXEL, np.float32))
    return shares, apply_edges_to_points(shares, borders, ["pot", "mug"], {"pot": shape})


@pytest.mark.parametrize(("shape", "tolerance"), [(EdgeShape(), 0), (EdgeShape(feather=0.01), 1e-6)])
def test_changes_below_the_spacing_leave_points_alone(shape, tolerance):
    before, after = shape_points(shape, others=0.3)
    np.testing.assert_allclose(after, before, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("choke", "width"), [(-16, 0), (-3, 0), (-0.5, 0), (0.5, 0), (16, 0), (-4, 20), (0, 20), (4, 20)]
)
def test_points_shift_and_fade_as_pictures_do(choke, width):
    _, after = shape_points(EdgeShape(choke, width))
    row = (choke * PIXEL < PLACES).astype(np.float32)
    if width:
        row = feather(np.tile(row, (3, 1)), width * PIXEL / SPACING)[1]
    is_clear = (width > 0) | (abs(PLACES - choke * PIXEL) > 1.01 * SPACING)
    np.testing.assert_allclose(after[is_clear, 0], row[is_clear], atol=0.02)


def test_points_do_not_spread_into_another_object():
    before, after = shape_points(EdgeShape(choke=-8), others=0.75)
    assert after.sum(1).max() <= 1 + 1e-6 and after[PLACES < 0, 0].max() == pytest.approx(0.25)
    np.testing.assert_array_equal(after[:, 1], before[:, 1])
