"""Colors added to an object change their own pigment and nothing else."""

import numpy as np
import pytest

from blender_tests.engine.palettes.conftest import GREEN, VIOLET, histogram_of, lit
from karf_engine.errors import BadRequest
from karf_engine.export.scene_points import ScenePoints
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.added import (
    append_added_sets,
    extended_palettes,
    match_added_color,
    object_paints,
    paint_of,
    propose_added_color,
    split_weights,
    split_weights_of_objects,
    wanted_color,
)
from karf_engine.palettes.color_histogram import ColorHistogram
from karf_engine.palettes.compositing import delta_composite, paper_composite
from karf_engine.palettes.matching.becomes import mean_weights
from karf_engine.palettes.matching.paints import pigment_gate
from karf_engine.palettes.palette import PROTECT, AddedColor, Palette

PALETTE = np.array([[0, 0, 0], [0.95, 0.1, 0.1], [0.1, 0.1, 0.95], [1, 1, 0.95]], np.float32)
RED, SILVER = np.array([0.8, 0.15, 0.15]), np.array([0.78, 0.75, 0.73])
PICTURE = np.stack([lit(RED), lit(VIOLET)]).astype(np.float32)  # of two pigments
SEEN = histogram_of(PICTURE.reshape(-1, 3), PALETTE)
WEIGHTS = SEEN.palette_weights.T.reshape(4, 2, 20)


def match_edit(color, wanted, palette=PALETTE, seen=SEEN):
    return np.concatenate([palette, match_added_color(seen, PALETTE, color, wanted)])


def composite(color, edited, compositing="delta"):
    shares = split_weights(WEIGHTS, PALETTE, [color])[None]
    if compositing == "delta":
        return delta_composite(PICTURE, shares, append_added_sets(PALETTE, [color])[None], edited[None])
    return paper_composite(0 * PICTURE, shares, np.ones((1, 2, 20)), edited[None])


def test_nothing_added_changes_nothing_and_black_cannot_be_added():
    planes = WEIGHTS[None]
    assert split_weights_of_objects(planes, [Palette("pot", PALETTE)], {}) is planes
    assert split_weights(WEIGHTS, PALETTE, ()) is WEIGHTS
    np.testing.assert_array_equal(append_added_sets(PALETTE, ()), PALETTE)
    with pytest.raises(BadRequest, match="source color is black"):
        match_added_color(SEEN, PALETTE, AddedColor(np.zeros(3)), GREEN)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_weights_split_exactly_and_black_stays_whole(kind):
    weights = np.random.default_rng(1).dirichlet(np.ones(len(PALETTE)), 500).T.astype(kind)
    shares = split_weights(weights, PALETTE, [AddedColor(VIOLET), AddedColor(RED, 0.5)])
    assert (shares >= 0).all() and (shares[5:8] > 0).any() and (shares[9:] > 0).any()
    parts = shares.reshape(3, *weights.shape).astype(np.float64)
    np.testing.assert_array_equal(parts[:, 1:].sum(0), weights[1:].astype(np.float64))
    np.testing.assert_array_equal(parts[:, 0], [weights[0], 0 * weights[0], 0 * weights[0]])


@pytest.mark.parametrize(("compositing", "tolerance"), [("delta", 1e-3), ("paper", 5e-3)])
def test_only_the_picked_pigment_becomes_the_target(compositing, tolerance):
    color = AddedColor(VIOLET)
    red, violet = composite(color, match_edit(color, GREEN), compositing)
    np.testing.assert_allclose(red, lit(RED), atol=tolerance)
    assert mean_ciede2000(violet, lit(GREEN)) < 2.5
    np.testing.assert_allclose(violet[-1], GREEN, atol=0.02)


def test_swatches_leave_the_picked_pigment_alone():
    color, palette = AddedColor(VIOLET), PALETTE.copy()
    palette[1] = [0.9, 0.8, 0.1]
    red, violet = composite(color, match_edit(color, VIOLET, palette))
    np.testing.assert_allclose(violet, lit(VIOLET), atol=2e-3)
    assert np.abs(red - lit(RED)).max() > 0.3


def test_reach_widens_the_hue_and_gray_is_selected_by_chroma():
    near, far = (split_weights(WEIGHTS, PALETTE, [AddedColor(VIOLET, reach)])[4:].sum() for reach in (0.2, 4.0))
    assert far > 1.5 * near > 0
    grey = np.full(3, 0.6)
    weights = histogram_of(np.concatenate([lit(grey), lit(RED)]).astype(np.float32), PALETTE).palette_weights
    shares = split_weights(weights.T, PALETTE, [AddedColor(grey)])[4:].sum(0)
    assert shares[:20].min() > 0.05 and shares[30:].max() < 1e-3


def test_objects_with_different_palettes_are_padded():
    palettes = [Palette("pot", PALETTE[:2]), Palette("mug", PALETTE)]
    planes, added = np.stack([WEIGHTS, WEIGHTS]), {"pot": [AddedColor(RED)]}
    planes[0, 2:] = 0
    shares = split_weights_of_objects(planes, palettes, added)
    assert [len(each.colors) for each in extended_palettes(palettes, added)] == [4, 4]
    assert shares.shape == (2, 4, 2, 20)
    np.testing.assert_array_equal(shares[1], WEIGHTS)
    np.testing.assert_allclose(shares[0].sum(0), planes[0].sum(0), atol=1e-6)


def test_points_are_recolored_like_pictures():
    n, color = 40, AddedColor(VIOLET)
    none, colors = np.zeros((n, 3), np.float32), np.rint(PICTURE.reshape(-1, 3) * 255).astype(np.uint8)
    own = SEEN.palette_weights[:, None]
    points = ScenePoints(("pot",), none, none, none[:, 0], colors, np.ones((n, 1)), own, PALETTE[None])
    edited = match_edit(color, GREEN)
    found = points.with_added([Palette("pot", PALETTE)], {"pot": [color]}).recolored(edited[None])
    np.testing.assert_allclose(found.reshape(2, 20, 3), composite(color, edited), atol=1 / 255)


def silver_with_letters(share_of_silver=0.5):
    """The histogram of a silver object with red letters."""
    seen = histogram_of(np.concatenate([lit(RED), lit(SILVER)]).astype(np.float32), PALETTE)
    return seen._replace(counts=np.repeat([1 - share_of_silver, share_of_silver], 20))


def test_protected_neutrals_stay():
    seen, differences = silver_with_letters(), []
    for protect in (0.0, 0.2):
        color = AddedColor(RED, 0.75, protect)
        shares = split_weights(seen.palette_weights.T, PALETTE, [color]).T
        change = shares @ (match_edit(color, GREEN, seen=seen) - append_added_sets(PALETTE, [color]))
        differences.append(mean_ciede2000(seen.colors, seen.colors + change))
        assert mean_ciede2000((seen.colors + change)[:20], lit(GREEN)) < 2.5
        assert (np.abs(change[20:]).max() < 1e-6) == bool(protect)
    assert differences[1] < differences[0]


@pytest.mark.parametrize(
    ("share_of_silver", "picked", "protect"),
    [(0.5, RED, PROTECT), (0.01, RED, 0.0), (0.5, np.full(3, 0.6), 0.0)],
    ids=["much silver", "highlights alone", "a picked gray"],
)
def test_protection_is_proposed_from_the_object_colors(share_of_silver, picked, protect):
    color = propose_added_color(silver_with_letters(share_of_silver), picked)
    assert color.protect == protect
    assert picked is RED or color.reach == AddedColor(RED).reach  # a gray has no hue to propose by


def test_proposed_reach_ends_before_the_next_pigment():
    alone, orange = ColorHistogram(lit(RED), np.ones(20), np.ones((20, 1))), lit(np.array([0.7, 0.35, 0.1]))
    both = ColorHistogram(np.concatenate([lit(RED), orange]), np.ones(40), np.ones((40, 1)))
    assert propose_added_color(alone, RED).reach == pytest.approx(0.75)
    reach = propose_added_color(both, RED).reach
    assert pigment_gate(orange, RED, reach).max() < 0.1 < pigment_gate(orange, RED, 1).max()


BLUE, PAPER = np.array([0.15, 0.25, 0.75]), np.array([0.9, 0.9, 0.88])


def painted(**shares):
    """The histogram of an object with shares of these colors, lit and in shade."""
    known = {"red": RED, "blue": BLUE, "violet": VIOLET, "silver": SILVER, "paper": PAPER}
    colors = np.concatenate([lit(known[name]) for name in shares]).astype(np.float32)
    return histogram_of(colors, PALETTE)._replace(counts=np.repeat(list(shares.values()), 20))


@pytest.mark.parametrize(
    ("shares", "wanted"),
    [
        ({"red": 1.0}, []),
        ({"red": 0.9, "paper": 0.1}, []),  # highlights alone
        ({"red": 0.3, "silver": 0.7}, [RED]),
        ({"red": 0.6, "blue": 0.4}, [RED, BLUE]),
        ({"red": 0.1, "blue": 0.2, "paper": 0.7}, [BLUE, RED]),
        ({"silver": 0.5, "paper": 0.5}, []),
    ],
    ids=["one paint", "one with highlights", "a print on silver", "two", "two on paper", "neutrals"],
)
def test_paints_are_those_that_an_object_shows_beside_others(shares, wanted):
    seen = painted(**shares)
    paints = object_paints(seen)
    assert len(paints) == len(wanted)
    for paint, color in zip(paints, wanted, strict=True):
        gate = pigment_gate(np.stack([RED, BLUE, SILVER, PAPER]), paint.picked, paint.reach, paint.protect)
        assert gate.max() > 0.9
        assert mean_ciede2000(paint.picked[None], color[None]) < 15
        assert np.sort(gate)[:-1].max() < 0.05
        np.testing.assert_array_equal(paint_of(seen, color).picked, paint.picked)


def test_changed_paint_leaves_other_paints_and_neutrals_and_takes_its_rims_along():
    rims = 0.5 * lit(RED) + 0.5 * lit(SILVER)
    seen = painted(red=0.3, blue=0.3, silver=0.4)
    paint = paint_of(seen, RED)
    colors = np.concatenate([lit(RED), lit(BLUE), lit(SILVER), rims]).astype(np.float32)
    shares = split_weights(histogram_of(colors, PALETTE).palette_weights.T, PALETTE, [paint]).T
    change = shares @ (match_edit(paint, GREEN, seen=seen) - append_added_sets(PALETTE, [paint]))
    moved = np.linalg.norm(change, axis=1).reshape(4, 20).mean(axis=1)
    assert moved[1:3].max() < 0.01 < 0.3 * moved[0] < moved[3] < 0.8 * moved[0]


def test_added_color_without_reach_changes_nothing():
    color = AddedColor(RED.astype(np.float32), 0.0)
    shares = split_weights(WEIGHTS, PALETTE, [color])
    np.testing.assert_array_equal(shares[:4], WEIGHTS)
    assert not shares[4:].any()


@pytest.mark.parametrize("shade", [0.5, 1.0])
def test_wanted_color_turns_the_source_into_the_target(shade):
    source, seen = lit(RED)[int(19 * shade)], painted(red=0.3, blue=0.3, silver=0.4)
    paint = paint_of(seen, source)
    wanted = wanted_color(seen, PALETTE, paint, source, GREEN)
    shares = split_weights(mean_weights(*seen, source)[:, None], PALETTE, [paint])[:, 0]
    change = shares @ (match_edit(paint, wanted, seen=seen) - append_added_sets(PALETTE, [paint]))
    assert mean_ciede2000((source + change)[None], GREEN[None]) < 1
