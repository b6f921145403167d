"""Edits by "becomes": the solvers against their optimality conditions, the rules against a sphere of known paint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from karf_engine.errors import BadRequest
from karf_engine.io.color import ciede2000, linear_to_srgb, srgb_to_lab, srgb_to_linear
from karf_engine.metrics.images import hue_shift, mean_ciede2000
from karf_engine.palettes.compositing import delta_composite
from karf_engine.palettes.matching.becomes import match_becomes, match_dragged, match_fewest, nearest_weights
from karf_engine.palettes.matching.fitting import bounded_least_squares, match_perceptually, match_pixels
from karf_engine.palettes.matching.paints import reflection_target
from karf_engine.palettes.palette_weights import star_weights

RED, BLUE, GREEN, YELLOW, CREAM = (
    np.array(color)
    for color in [(0.7, 0.1, 0.1), (0.1, 0.2, 0.7), (0.1, 0.5, 0.2), (0.9, 0.75, 0.1), (0.85, 0.8, 0.65)]
)


@dataclass(frozen=True)
class Sphere:
    """A glossy sphere, with cream stripes or without: its pixels before and after the change of its paint."""

    before: np.ndarray
    after: np.ndarray
    paint: np.ndarray

    @property
    def eyedroppers(self) -> tuple[np.ndarray, np.ndarray]:
        return np.median(self.before[self.paint], axis=0), np.median(self.after[self.paint], axis=0)


def make_sphere(first: np.ndarray, second: np.ndarray, striped: bool = False) -> Sphere:
    y, x = np.mgrid[1:-1:64j, -1:1:64j]
    inside = x * x + y * y < 0.95
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)[inside]
    light = np.array([0.4, 0.6, 0.7]) / np.linalg.norm([0.4, 0.6, 0.7])
    half = light + np.array([0, 0, 1])
    half /= np.linalg.norm(half)
    shading = 0.25 + 0.75 * np.maximum(normal @ light, 0)
    gloss = 0.02 + 0.5 * np.maximum(normal @ half, 0) ** 40
    paint = np.floor(normal[:, 1] * 5) % 2 == 0 if striped else np.ones(len(normal), bool)

    def shown(color: np.ndarray) -> np.ndarray:
        albedo = srgb_to_linear(np.where(paint[:, None], color, CREAM))
        light = np.clip(albedo * shading[:, None] + gloss[:, None], 0, 1)
        return np.rint(linear_to_srgb(light) * 255) / 255

    return Sphere(shown(first), shown(second), paint)


def tetrahedron_weights(colors: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Barycentric coordinates over black and three colors."""
    mix = colors @ np.linalg.inv(palette[1:])
    return np.hstack([1 - mix.sum(axis=1, keepdims=True), mix])


PALETTE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)


def recolored(sphere: Sphere, palette: np.ndarray, edited: np.ndarray) -> np.ndarray:
    planes = tetrahedron_weights(sphere.before, palette).T[None, :, None].astype(np.float32)
    base = sphere.before[None].astype(np.float32)
    return delta_composite(base, np.maximum(planes, 0), palette[None], edited[None])[0]


@pytest.mark.parametrize(("first", "second"), [(RED, BLUE), (RED, GREEN), (BLUE, YELLOW), (YELLOW, RED)])
def test_model_target_is_close_to_the_repainted_sphere(first: np.ndarray, second: np.ndarray) -> None:
    sphere = make_sphere(first, second)
    target = reflection_target(sphere.before, *sphere.eyedroppers)
    assert mean_ciede2000(sphere.before, sphere.after) > 25
    assert mean_ciede2000(target, sphere.after) < 1.5


def test_model_leaves_other_pigments_alone() -> None:
    sphere = make_sphere(RED, BLUE, striped=True)
    target = reflection_target(sphere.before, *sphere.eyedroppers)
    stripes = ~sphere.paint
    assert mean_ciede2000(target, sphere.before, stripes) < 0.5
    assert mean_ciede2000(target, sphere.after, sphere.paint) < 1.5


def test_same_source_and_target_change_nothing() -> None:
    sphere = make_sphere(RED, RED, striped=True)
    np.testing.assert_allclose(reflection_target(sphere.before, RED, RED), sphere.before, atol=1e-7)
    weights = tetrahedron_weights(sphere.before, PALETTE)
    edited = match_becomes(sphere.before, np.ones(len(weights)), weights, PALETTE, RED, RED)
    assert edited.tobytes() == PALETTE.tobytes()


def test_gloss_is_never_negative() -> None:
    r, t = srgb_to_linear(np.array([0.8, 0.5, 0.4])), srgb_to_linear(np.array([0.8, 0.6, 0.3]))
    # a more saturated red than the source: the plain split would be 0.8 r - 0.05 (1, 1, 1)
    light = 0.8 * r - 0.05
    shading = light @ r / (r @ r)
    moved = reflection_target(linear_to_srgb(light)[None], linear_to_srgb(r), linear_to_srgb(t))[0]
    full = np.linalg.norm(shading * (t - r))
    assert 0.9 < np.linalg.norm(srgb_to_linear(moved) - light) / full <= 1 + 1e-6


def test_source_itself_becomes_the_target() -> None:
    for source, target in [(RED, BLUE), (CREAM, GREEN), (np.full(3, 0.6), RED), (YELLOW, np.ones(3))]:
        np.testing.assert_allclose(reflection_target(source[None], source, target)[0], target, atol=1e-6)


def test_black_source_is_refused() -> None:
    with pytest.raises(BadRequest, match="black"):
        reflection_target(np.ones((1, 3)), np.zeros(3), RED)


def test_grey_source_leaves_strong_colors_alone() -> None:
    grey, target = np.full(3, 0.7), np.array([0.7, 0.2, 0.2])
    moved = reflection_target(np.array([[0.5, 0.5, 0.5], [0.1, 0.2, 0.9]]), grey, target)
    np.testing.assert_allclose(moved[1], [0.1, 0.2, 0.9], atol=1e-6)
    # half grey becomes the darker red: linear light in proportion
    expected = srgb_to_linear(0.5) / srgb_to_linear(0.7) * srgb_to_linear(target)
    np.testing.assert_allclose(srgb_to_linear(moved[0]), expected, atol=1e-6)


@pytest.mark.parametrize("striped", [False, True])
def test_becomes_is_far_below_no_edit_and_below_a_hue_shift(striped: bool) -> None:
    sphere = make_sphere(RED, GREEN, striped)
    # black, the paint lit, the gloss, the stripes
    palette = np.array([[0, 0, 0], [0.75, 0.05, 0.05], [1, 0.95, 0.95], [1, 0.95, 0.6]], np.float32)
    weights = tetrahedron_weights(sphere.before, palette)
    edited = match_becomes(sphere.before, np.ones(len(weights)), weights, palette, *sphere.eyedroppers)
    error = mean_ciede2000(recolored(sphere, palette, edited), sphere.after)
    unedited = mean_ciede2000(sphere.before, sphere.after)
    shifted = mean_ciede2000(hue_shift(sphere.before, *sphere.eyedroppers), sphere.after)
    assert error < 0.1 * unedited
    assert error < 0.5 * shifted


def test_paints_of_one_thing_are_repainted_together() -> None:
    paint, stripes = make_sphere(GREEN, RED, striped=True), make_sphere(GREEN, GREEN, striped=True)
    before, inside = stripes.before, stripes.paint
    palette = np.array([[0, 0, 0], [0.05, 0.6, 0.2], [1, 1, 0.95], [0.95, 0.85, 0.6]], np.float32)
    sources = np.stack([np.median(before[each], axis=0) for each in (inside, ~inside)])
    targets = np.stack([np.median(paint.after[inside], axis=0), BLUE])
    repainted = reflection_target(before, sources, targets)
    assert mean_ciede2000(repainted, paint.after, inside) < 2.5  # gloss on green has the stripes' color
    weights = tetrahedron_weights(before, palette)
    edited = match_becomes(before, np.ones(len(weights)), weights, palette, sources, targets)
    shown = recolored(stripes, palette, edited)
    for each, target in zip((inside, ~inside), targets, strict=True):
        assert mean_ciede2000(np.median(shown[each], axis=0), target) < 4


def two_paints_of_one_hue():
    """Colors of a bowl that is violet on one half and blue-violet on the other, lit and in the shade; and which are violet."""
    violet, blue = np.array([0.5, 0.3, 0.5]), np.array([0.32, 0.3, 0.6])
    shades = np.linspace(0.1, 1, 20)[:, None]
    light = np.concatenate([shades * srgb_to_linear(violet), shades * srgb_to_linear(blue)])
    return linear_to_srgb(light), np.arange(40) < 20


def test_a_paint_that_nobody_asked_to_change_holds() -> None:
    colors, is_violet = two_paints_of_one_hue()
    palette = np.array([[0, 0, 0], [0.55, 0.3, 0.5], [0.3, 0.3, 0.65]], np.float32)
    weights = star_weights(colors, palette)
    edited = match_becomes(colors, np.ones(40), weights, palette, colors[19], GREEN)
    shown = np.clip(colors + weights @ (edited - palette), 0, 1)
    green = linear_to_srgb(np.linspace(0.1, 1, 20)[:, None] * srgb_to_linear(GREEN))
    assert mean_ciede2000(shown[is_violet], green) < 4
    assert mean_ciede2000(shown[~is_violet], colors[~is_violet]) < 4
    # where both are asked, none holds
    both = match_becomes(colors, np.ones(40), weights, palette, colors[[19, 39]], np.stack([GREEN, GREEN]))
    assert mean_ciede2000(np.clip(colors + weights @ (both - palette), 0, 1)[~is_violet], green) < 6


def test_what_lies_between_two_paints_is_repainted_as_their_mixture() -> None:
    light = srgb_to_linear(np.stack([GREEN, RED]))
    mixed = linear_to_srgb(light.mean(axis=0, keepdims=True))
    moved = reflection_target(mixed, np.stack([GREEN, RED]), np.stack([GREEN, BLUE]))
    expected = linear_to_srgb((light[:1] + srgb_to_linear(BLUE)) / 2)
    assert mean_ciede2000(moved, expected) < 1


def test_colored_light_tints_the_new_paint_as_the_old() -> None:
    warm = np.array([1.2, 1.0, 0.75])
    shown = linear_to_srgb(warm * srgb_to_linear(CREAM))[None]
    moved = reflection_target(shown, CREAM, np.array([0.5, 0.6, 0.75]))
    lit, plain = (linear_to_srgb(light * srgb_to_linear(np.array([[0.5, 0.6, 0.75]]))) for light in (warm, 1.0))
    assert mean_ciede2000(moved, lit) < 0.85 * mean_ciede2000(plain, lit)


def test_two_picks_that_look_alike_do_not_spoil_what_is_not_picked() -> None:
    palette = np.array([[0, 0, 0], [0.87, 1, 0.92], [0.97, 0.96, 1], [0, 0.68, 0.69]], np.float32)
    weights = np.random.default_rng(3).dirichlet([3, 5, 2, 1], 300)
    colors = weights @ palette
    sources = np.array([[0.596, 0.694, 0.659], [0.573, 0.663, 0.643]])
    targets = np.array([[0.706, 0.635, 0.522], [0.663, 0.647, 0.494]])
    edited = match_becomes(colors, np.ones(300), weights, palette, sources, targets)
    shown = np.clip(colors + weights @ (edited - palette), 0, 1)
    assert mean_ciede2000(shown, reflection_target(colors, sources, targets)) < 3


def test_a_pale_paints_shades_are_paint_and_no_gloss() -> None:
    pale, darker = np.array([0.75, 0.75, 0.85]), np.array([0.5, 0.6, 0.75])
    shades = np.linspace(0.2, 1, 9)[:, None]
    light = shades * srgb_to_linear(pale) + np.random.default_rng(0).normal(0, 0.004, (9, 3))  # a photo's noise
    moved = reflection_target(linear_to_srgb(light), pale, darker)
    assert mean_ciede2000(moved, linear_to_srgb(shades * srgb_to_linear(darker))) < 2


def test_brighter_paint_takes_swatches_beyond_white() -> None:
    sphere = make_sphere(GREEN, YELLOW)
    # black, and colors that enclose those of the sphere
    palette = np.array([[0, 0, 0], [0.1, 0.75, 0.25], [1, 1, 0.95], [0.95, 1, 1]], np.float32)
    weights = tetrahedron_weights(sphere.before, palette)
    edited = match_becomes(sphere.before, np.ones(len(weights)), weights, palette, *sphere.eyedroppers)
    assert edited.max() > 1
    error = mean_ciede2000(recolored(sphere, palette, edited), sphere.after)
    held_to_white = mean_ciede2000(recolored(sphere, palette, edited.clip(0, 1)), sphere.after)
    assert error < 0.6 * held_to_white


def test_locked_entries_and_black_stay_bit_by_bit() -> None:
    sphere = make_sphere(RED, BLUE)
    weights = tetrahedron_weights(sphere.before, PALETTE)
    edited = match_becomes(sphere.before, np.ones(len(weights)), weights, PALETTE, RED, BLUE, locked=(2,))
    np.testing.assert_array_equal(edited[[0, 2]], PALETTE[[0, 2]])
    assert (edited[1] != PALETTE[1]).any()
    fewest = match_fewest(np.array([0, 0.2, 0.5, 0.3]), PALETTE, BLUE, locked=(2,))
    np.testing.assert_array_equal(fewest[[0, 2]], PALETTE[[0, 2]])


def test_painted_view_is_matched_exactly_where_a_palette_can() -> None:
    random = np.random.default_rng(5)
    weights = random.dirichlet(np.ones(4), 500)
    wanted = np.array([[0, 0, 0], [0.2, 0.7, 0.4], [0.9, 0.3, 0.1], [0.3, 0.3, 0.6]])
    edited = match_pixels(weights, weights @ PALETTE, weights @ wanted, PALETTE)
    # the ridge, one thousandth of the counts, holds back a little
    np.testing.assert_allclose(edited, wanted, atol=0.03)


def test_what_cannot_be_moved_apart_pulls_less_by_what_is_seen_than_by_squares() -> None:
    random = np.random.default_rng(8)
    weights = np.repeat(random.dirichlet(np.ones(4), 60), 2, axis=0)  # pairs of one color, of which one is to stay
    colors, counts = weights @ PALETTE, np.tile([3.0, 1.0], 60)
    targets = np.where(np.arange(120)[:, None] % 2, weights @ PALETTE[[0, 2, 3, 1]], colors)
    means = []
    for match in (match_pixels, match_perceptually):
        edited = match(weights, colors, targets, PALETTE, counts, (2,))
        np.testing.assert_array_equal(edited[[0, 2]], PALETTE[[0, 2]])
        shown = np.clip(colors + weights @ (edited - PALETTE), 0, 1)
        means.append(np.average(ciede2000(srgb_to_lab(shown), srgb_to_lab(targets)), weights=counts))
    assert means[1] < 0.9 * means[0]


def test_what_is_met_keeps_every_bit() -> None:
    weights = np.random.default_rng(9).dirichlet(np.ones(4), 30)
    colors = weights @ PALETTE
    np.testing.assert_array_equal(match_perceptually(weights, colors, colors, PALETTE, np.ones(30)), PALETTE)


def test_counts_weigh_like_repeated_pixels() -> None:
    random = np.random.default_rng(6)
    weights, colors, targets = random.dirichlet(np.ones(4), 20), random.random((20, 3)), random.random((20, 3))
    counts = random.integers(1, 5, 20)
    weighted = match_pixels(weights, colors, targets, PALETTE, counts)
    repeated = match_pixels(*(np.repeat(each, counts, axis=0) for each in (weights, colors, targets)), PALETTE)
    np.testing.assert_allclose(weighted, repeated, atol=1e-6)


def test_least_squares_meets_its_optimality_conditions() -> None:
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


def test_fewest_moves_the_one_swatch_that_has_most_of_the_pixel() -> None:
    palette = np.array([[0, 0, 0], [0.5, 0.5, 0.5], [0.4, 0.5, 0.6], [0.5, 0.3, 0.5]], np.float32)
    weights = np.array([0.1, 0.2, 0.6, 0.1])
    target = weights @ palette + [0.06, -0.12, 0.18]
    edited = match_fewest(weights, palette, target)
    np.testing.assert_array_equal(edited[[0, 1, 3]], palette[[0, 1, 3]])
    # the whole change over its weight 0.6
    np.testing.assert_allclose(edited[2], palette[2] + [0.1, -0.2, 0.3], atol=1e-5)


def test_fewest_uses_a_second_swatch_only_beyond_the_first_ones_reach() -> None:
    palette = np.array([[0, 0, 0], [0.5, 0.5, 0.5], [0.9, 0.5, 0.5]], np.float32)
    weights = np.array([0, 0.4, 0.6])
    target = weights @ palette + [0.1, 0, 0]
    edited = match_fewest(weights, palette, target)
    # entry 2 has room for 0.1 x 0.6 = 0.06; entry 1 gives the other 0.04
    np.testing.assert_allclose(edited[:, 0], [0, 0.6, 1], atol=1e-4)
    np.testing.assert_allclose(weights @ edited, target, atol=1e-5)


def test_target_out_of_reach_is_met_as_closely_as_the_box_allows() -> None:
    palette = np.array([[0, 0, 0], [0.5, 0.5, 0.5]], np.float32)
    edited = match_fewest(np.array([0.5, 0.5]), palette, np.array([1.0, 0.0, 0.3]))
    np.testing.assert_allclose(edited[1], [1, 0, 0.6], atol=1e-5)


def test_fewest_starts_from_the_color_shown() -> None:
    palette = np.array([[0, 0, 0], [0.5, 0.5, 0.5]], np.float32)
    # the photo shows 0.1 more than the palette gives
    edited = match_fewest(np.array([0.5, 0.5]), palette, np.full(3, 0.4), shown=np.full(3, 0.35))
    np.testing.assert_allclose(edited[1], np.full(3, 0.6), atol=1e-5)


def test_eyedropper_takes_the_weights_of_the_nearest_color() -> None:
    colors = np.array([[1, 0, 0], [0, 1, 0], [0.1, 0.1, 0.1]])
    np.testing.assert_array_equal(nearest_weights(colors, np.eye(3), np.array([0.8, 0.2, 0.1])), [1, 0, 0])


def lit_and_shaded():
    """Weights of a red thing's lit and shaded pixels, and its palette: black, lit, shaded."""
    palette = np.array([[0, 0, 0], [0.7, 0.1, 0.1], [0.35, 0.05, 0.05]], np.float32)
    weights = np.repeat(np.eye(3)[1:], 10, axis=0)
    return weights @ palette, np.ones(20), weights, palette


def test_a_dragged_swatch_is_what_it_is_given_and_its_shade_follows():
    color = np.array([1.4, 0.2, 0.3], np.float32)  # brighter than white
    edited = match_dragged(*lit_and_shaded(), 1, color)
    assert (edited[1] == color).all() and (edited[0] == 0).all()
    assert edited[2, 0] > 0.6  # half as bright in sRGB, as before
    brighter = match_dragged(*lit_and_shaded(), 1, np.array([1.8, 0.2, 0.3], np.float32))
    assert brighter[2, 0] > edited[2, 0] + 0.1  # also beyond white the shade follows


def test_a_drag_to_where_it_began_changes_no_bit_and_one_of_black_takes_nothing_along():
    seen = lit_and_shaded()
    palette = seen[-1]
    assert (match_dragged(*seen, 1, palette[1]) == palette).all()
    dark = palette.copy()
    dark[2] = 0.001
    edited = match_dragged(*seen[:-1], dark, 2, np.array([0.1, 0.2, 0.9], np.float32))
    assert (edited[:2] == dark[:2]).all() and edited[2, 2] == np.float32(0.9)


def test_locked_swatches_do_not_follow_a_drag():
    edited = match_dragged(*lit_and_shaded(), 1, np.array([0.1, 0.2, 0.7], np.float32), locked=[2])
    assert (edited[2] == lit_and_shaded()[-1][2]).all()


def metal_and_varnish():
    """What a metal shows of a room, by two reflectances: its floor is dark and brown, its ceiling is light and white."""
    room = np.concatenate([np.linspace(0.05, 1.0, 30), np.linspace(1.0, 2.0, 10)])[:, None]
    room = room ** np.where(room < 1, [0.8, 1.0, 1.3], 1.0)
    blue, gold = srgb_to_linear(np.array([0.35, 0.5, 0.85])), srgb_to_linear(np.array([0.85, 0.65, 0.35]))
    return [np.clip(linear_to_srgb(room * reflectance), 0, 1) for reflectance in (gold, blue)]


def test_a_metals_highlights_take_its_color():
    gold, blue = metal_and_varnish()
    source, target = gold[29], blue[29]
    as_metal = mean_ciede2000(reflection_target(gold, source, target, True), blue)
    as_varnish = mean_ciede2000(reflection_target(gold, source, target), blue)
    assert as_metal < 1 and as_metal < as_varnish / 2


def test_metal_reaches_the_palette_by_becomes_and_by_a_drag():
    gold, blue = metal_and_varnish()
    palette = np.array([[0, 0, 0], [1, 0.77, 0.42], [1, 1, 0.6]], np.float32)
    weights = star_weights(gold, palette)
    solved = match_becomes(gold, np.ones(40), weights, palette, gold[29], blue[29], is_metal=True)
    dragged = match_dragged(gold, np.ones(40), weights, palette, 1, solved[1], is_metal=True)
    plain = match_dragged(gold, np.ones(40), weights, palette, 1, solved[1])
    difference = {
        name: mean_ciede2000(np.clip(gold + weights @ (found - palette), 0, 1), blue)
        for name, found in {"solved": solved, "dragged": dragged, "plain": plain}.items()
    }
    assert difference["solved"] < 4 and difference["dragged"] < difference["plain"], difference
