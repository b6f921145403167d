"""Edits by "becomes", on spheres of known paint, and the solvers behind them."""

import numpy as np
import pytest

from blender_tests.engine.palettes import conftest
from blender_tests.engine.palettes.conftest import BLUE, CREAM, GREEN, RED, YELLOW, histogram_of, lit, recolor
from karf_engine.errors import BadRequest
from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.metrics.images import hue_shift, mean_ciede2000
from karf_engine.palettes.matching.becomes import match_becomes, match_dragged, match_fewest, nearest_weights
from karf_engine.palettes.matching.fitting import bounded_least_squares, match_perceptually, match_pixels
from karf_engine.palettes.matching.paints import reflection_target

IS_PAINT = conftest.sphere_normals()[1]  # of a striped sphere
PALETTE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
GREY, PALE = np.full(3, 0.7), (0.75, 0.75, 0.85)
RED_SWATCHES = [[0, 0, 0], [0.75, 0.05, 0.05], [1, 0.95, 0.95], [1, 0.95, 0.6]]  # black, paint, gloss, stripes
HALF = [0.5, 0.5, 0.5]


def repainted_sphere(first, second, stripes=None, other=None):
    """A sphere before and after, its pixels that change, and their colors as an eyedropper takes them."""
    before = conftest.glossy_sphere(first, stripes=stripes)
    after = conftest.glossy_sphere(second, stripes=stripes if other is None else other)
    paints = [IS_PAINT | (stripes is None), ~IS_PAINT][: 1 + (other is not None)]
    picked = (np.squeeze([np.median(each[paint], axis=0) for paint in paints]) for each in (before, after))
    return before, after, np.any(paints, axis=0), *picked


@pytest.mark.parametrize(
    "paints",
    [(RED, BLUE), (RED, GREEN), (BLUE, YELLOW), (YELLOW, RED), (RED, BLUE, CREAM), (GREEN, RED, CREAM, BLUE)],
)
def test_model_repaints_a_sphere_and_keeps_its_stripes(paints):
    before, after, is_changed, source, target = repainted_sphere(*paints)
    result = reflection_target(before, source, target)
    assert mean_ciede2000(before, after, is_changed) > 25
    assert mean_ciede2000(result, after, is_changed) < 1.5
    assert is_changed.all() or mean_ciede2000(result, before, ~is_changed) < 0.5


def mix_light(*lights):
    """The mean of the light of colors, sRGB [1, 3]."""
    return linear_to_srgb(np.mean([srgb_to_linear(np.array(each)) for each in lights], axis=0))[None]


def shades(paint, noise=0.0):
    light = np.linspace(0.2, 1, 9)[:, None] * srgb_to_linear(np.array(paint))
    return linear_to_srgb(light + np.random.default_rng(0).normal(0, noise, (9, 3)))


@pytest.mark.parametrize(
    ("colors", "sources", "targets", "expected", "tolerance"),
    [
        *((one[None], one, other, other[None], 1e-4) for one, other in ((RED, BLUE), (CREAM, GREEN), (GREY, YELLOW))),
        (shades(GREY), GREY, RED, shades(RED), 1e-4),
        (shades(BLUE), GREY, RED, shades(BLUE), 1e-4),  # a gray source leaves strong colors alone
        (mix_light(GREEN, RED), [GREEN, RED], [GREEN, BLUE], mix_light(GREEN, BLUE), 1),
        (shades(PALE, noise=0.004), PALE, (0.5, 0.6, 0.75), shades((0.5, 0.6, 0.75)), 2),  # no gloss
    ],
)
def test_shaded_and_mixed_paints_become_the_target(colors, sources, targets, expected, tolerance):
    moved = reflection_target(colors, np.array(sources), np.array(targets))
    assert mean_ciede2000(moved, expected) < tolerance


def test_gloss_is_never_negative():
    r, t = srgb_to_linear(np.array([0.8, 0.5, 0.4])), srgb_to_linear(np.array([0.8, 0.6, 0.3]))
    # a more saturated red than the source: the plain split would be 0.8 r - 0.05 (1, 1, 1)
    light = 0.8 * r - 0.05
    moved = reflection_target(linear_to_srgb(light)[None], linear_to_srgb(r), linear_to_srgb(t))[0]
    full = np.linalg.norm(light @ r / (r @ r) * (t - r))
    assert 0.9 < np.linalg.norm(srgb_to_linear(moved) - light) / full <= 1 + 1e-6


def test_colored_light_tints_the_new_paint():
    warm, target = np.array([1.2, 1.0, 0.75]), np.array([0.5, 0.6, 0.75])
    moved = reflection_target(linear_to_srgb(warm * srgb_to_linear(CREAM))[None], CREAM, target)
    tinted, plain = (linear_to_srgb(light * srgb_to_linear(target[None])) for light in (warm, 1.0))
    assert mean_ciede2000(moved, tinted) < 0.85 * mean_ciede2000(plain, tinted)


def test_black_source_is_rejected():
    with pytest.raises(BadRequest, match="black"):
        reflection_target(np.ones((1, 3)), np.zeros(3), RED)


@pytest.mark.parametrize(
    ("paints", "swatches"),
    [
        ((RED, GREEN), RED_SWATCHES),
        ((RED, GREEN, CREAM), RED_SWATCHES),
        ((GREEN, YELLOW), [[0, 0, 0], [0.1, 0.75, 0.25], [1, 1, 0.95], [0.95, 1, 1]]),
        ((GREEN, RED, CREAM, BLUE), [[0, 0, 0], [0.05, 0.6, 0.2], [1, 1, 0.95], [0.95, 0.85, 0.6]]),
    ],
)
def test_becomes_beats_no_edit_and_a_hue_shift(paints, swatches):
    before, after, _, source, target = repainted_sphere(*paints)
    palette = np.array(swatches, np.float32)
    seen = histogram_of(before, palette)
    edited = match_becomes(*seen, palette, source, target)
    error = mean_ciede2000(recolor(seen, palette, edited), after)
    assert error < 0.1 * mean_ciede2000(before, after)
    assert source.ndim > 1 or error < 0.5 * mean_ciede2000(hue_shift(before, source, target), after)
    if paints[1] is YELLOW:  # brighter than the old paint: the edit must exceed white
        clipped = mean_ciede2000(recolor(seen, palette, edited.clip(0, 1)), after)
        assert edited.max() > 1 and error < 0.6 * clipped


def test_unpicked_paints_stay():
    violet, blue = lit(np.array([0.5, 0.3, 0.5])), lit(np.array([0.32, 0.3, 0.6]))
    palette = np.array([[0, 0, 0], [0.55, 0.3, 0.5], [0.3, 0.3, 0.65]], np.float32)
    seen = histogram_of(np.concatenate([violet, blue]), palette)
    result = recolor(seen, palette, match_becomes(*seen, palette, violet[-1], GREEN))
    assert mean_ciede2000(result[:20], lit(GREEN)) < 4
    assert mean_ciede2000(result[20:], blue) < 4
    both = match_becomes(*seen, palette, np.stack([violet[-1], blue[-1]]), np.stack([GREEN, GREEN]))
    assert mean_ciede2000(recolor(seen, palette, both)[20:], lit(GREEN)) < 6


def test_similar_picks_do_not_spoil_unpicked_colors():
    palette = np.array([[0, 0, 0], [0.87, 1, 0.92], [0.97, 0.96, 1], [0, 0.68, 0.69]], np.float32)
    seen = histogram_of(np.random.default_rng(3).dirichlet([3, 5, 2, 1], 300) @ palette, palette)
    sources = np.array([[0.596, 0.694, 0.659], [0.573, 0.663, 0.643]])
    targets = np.array([[0.706, 0.635, 0.522], [0.663, 0.647, 0.494]])
    result = recolor(seen, palette, match_becomes(*seen, palette, sources, targets))
    assert mean_ciede2000(result, reflection_target(seen.colors, sources, targets)) < 3


def test_metal_highlights_take_the_new_color():
    # the reflected room has a dark brown floor and a light white ceiling
    room = np.concatenate([np.linspace(0.05, 1.0, 30), np.linspace(1.0, 2.0, 10)])[:, None]
    room = room ** np.where(room < 1, [0.8, 1.0, 1.3], 1.0)
    paints = np.array([(0.85, 0.65, 0.35), (0.35, 0.5, 0.85)])
    gold, blue = linear_to_srgb(room * srgb_to_linear(paints)[:, None]).clip(0, 1)
    source, target = gold[29], blue[29]
    as_metal = mean_ciede2000(reflection_target(gold, source, target, True), blue)
    assert as_metal < 1 and as_metal < mean_ciede2000(reflection_target(gold, source, target), blue) / 2
    palette = np.array([[0, 0, 0], [1, 0.77, 0.42], [1, 1, 0.6]], np.float32)
    seen = histogram_of(gold, palette)
    solved = match_becomes(*seen, palette, source, target, is_metal=True)
    dragged, plain = (match_dragged(*seen, palette, 1, solved[1], is_metal=is_metal) for is_metal in (True, False))
    errors = [mean_ciede2000(recolor(seen, palette, edited), blue) for edited in (solved, dragged, plain)]
    assert errors[0] < 4 and errors[1] < errors[2]


def test_dragged_swatch_takes_its_color_and_shades_follow():
    palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1], [0.35, 0.05, 0.05], [0.001, 0.001, 0.001]], np.float32)
    weights = np.repeat(np.eye(4)[1:3], 10, axis=0)
    seen = weights @ palette, np.ones(20), weights
    red, brighter = (match_dragged(*seen, palette, 1, np.float32([value, 0.2, 0.3])) for value in (1.4, 1.8))
    np.testing.assert_array_equal(red[:2], np.float32([[0, 0, 0], [1.4, 0.2, 0.3]]))
    assert red[2, 0] > 0.6  # half as bright in sRGB, as before
    assert brighter[2, 0] > red[2, 0] + 0.1
    black = match_dragged(*seen, palette, 3, np.float32([0.1, 0.2, 0.9]))  # takes nothing along
    np.testing.assert_array_equal(black, [*palette[:3], np.float32([0.1, 0.2, 0.9])])


@pytest.mark.parametrize("color", [(0.3, 0.0, 0.3), (0.0, 0.35, 0.35), (0.05, 0.05, 0.4)])
def test_highlights_stay_neutral_when_a_swatch_is_dragged_to_a_dark_color(color):
    palette = np.array([[0, 0, 0], [1, 0, 0], [1, 0.95, 0.95]], np.float32)  # no pixel is as saturated as the swatch
    seen = histogram_of(conftest.glossy_sphere(np.array([0.8, 0.2, 0.2])), palette)
    gloss = match_dragged(*seen, palette, 1, np.float32(color))[2]
    assert np.ptp(gloss) < 0.08


def test_perceptual_fit_keeps_inseparable_pixels_closer():
    weights = np.repeat(np.random.default_rng(8).dirichlet(np.ones(4), 60), 2, axis=0)
    colors, counts = weights @ PALETTE, np.tile([3.0, 1.0], 60)  # pairs of one color, the first one is to stay
    targets = np.where(np.arange(120)[:, None] % 2, weights @ PALETTE[[0, 2, 3, 1]], colors)
    stays = np.arange(120) % 2 == 0
    off = []
    for match in (match_pixels, match_perceptually):
        edited = match(weights, colors, targets, PALETTE, counts, (2,))
        result = np.clip(colors + weights @ (edited - PALETTE), 0, 1)
        off.append(0.75 * mean_ciede2000(result, targets, stays) + 0.25 * mean_ciede2000(result, targets, ~stays))
    assert off[1] < 0.9 * off[0]


def test_pixel_fit_is_exact_and_counts_act_as_repetitions():
    random = np.random.default_rng(6)
    weights, wanted = random.dirichlet(np.ones(4), 500), np.vstack([np.zeros(3), 0.1 + 0.8 * random.random((3, 3))])
    edited = match_pixels(weights, weights @ PALETTE, weights @ wanted, PALETTE)
    np.testing.assert_allclose(edited, wanted, atol=0.03)  # the ridge holds back a little
    pixels, counts = (weights[:20], random.random((20, 3)), random.random((20, 3))), random.integers(1, 5, 20)
    repeated = match_pixels(*(np.repeat(each, counts, axis=0) for each in pixels), PALETTE)
    np.testing.assert_allclose(match_pixels(*pixels, PALETTE, counts), repeated, atol=1e-6)


def test_least_squares_meets_its_optimality_conditions():
    random = np.random.default_rng(7)
    for trial in range(200):
        n, entries = random.integers(1, 30), random.integers(1, 9)
        matrix, values = random.random((n, entries)), random.normal(size=(n, 2))
        if trial % 3 == 0:
            matrix[:, -1] = matrix[:, 0]  # two entries that every pixel uses alike
        lower, upper = -random.random((entries, 2)), random.random((entries, 2))
        lower[0] = upper[0] = 0
        counts = random.random(n)
        x = bounded_least_squares(matrix, values, lower, upper, counts, ridge=1e-4)
        assert (x >= lower).all() and (x <= upper).all()
        gradient = matrix.T @ (counts[:, None] * (matrix @ x - values)) / counts.sum() + 1e-4 * x
        assert np.abs(gradient[(x > lower) & (x < upper)]).max(initial=0) < 1e-8
        assert gradient[(x == lower) & (lower < upper)].min(initial=0) > -1e-8
        assert gradient[(x == upper) & (lower < upper)].max(initial=0) < 1e-8


@pytest.mark.parametrize(
    ("swatches", "weights", "shown", "change", "expected"),
    [
        # the swatch with most weight, 0.6, takes the whole change
        ([HALF, [0.4, 0.5, 0.6], [0.5, 0.3, 0.5]], [0.1, 0.2, 0.6, 0.1], None, [0.06, -0.12, 0.18],
         [HALF, [0.5, 0.3, 0.9], [0.5, 0.3, 0.5]]),
        # the second has room for 0.1 x 0.6 = 0.06, the first gives the other 0.04
        ([HALF, [0.9, 0.5, 0.5]], [0, 0.4, 0.6], None, [0.1, 0, 0], [[0.6, 0.5, 0.5], [1, 0.5, 0.5]]),
        # out of reach: as close as the range allows
        ([HALF], [0.5, 0.5], None, [0.75, -0.25, 0.05], [[1, 0, 0.6]]),
        # the photo shows 0.1 more than the palette gives
        ([HALF], [0.5, 0.5], [0.35] * 3, [0.15] * 3, [[0.6] * 3]),
    ],
)  # fmt: skip
def test_fewest_moves_as_few_swatches_as_needed(swatches, weights, shown, change, expected):
    palette, weights = np.array([[0, 0, 0], *swatches], np.float32), np.array(weights)
    shown = None if shown is None else np.array(shown)
    edited = match_fewest(weights, palette, weights @ palette + change, shown=shown)
    np.testing.assert_allclose(edited[1:], expected, atol=1e-4)
    np.testing.assert_array_equal(edited == palette, np.isclose(edited, palette, atol=1e-4))
    nearest = nearest_weights(np.eye(len(palette), 3), np.eye(len(palette)), np.array([0.2, 0.8, 0.1]))
    np.testing.assert_array_equal(nearest, np.eye(len(palette))[1])  # what an eyedropper takes
