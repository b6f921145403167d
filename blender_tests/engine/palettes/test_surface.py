"""Saturation, brightness and gloss of a paint: against a sphere whose true look is known, and what must not change."""

from __future__ import annotations

import numpy as np
import pytest

from karf_engine.errors import BadRequest
from karf_engine.io.color import ciede2000, lab_chroma, linear_to_srgb, srgb_to_lab, srgb_to_linear
from karf_engine.palettes.matching.surface import Surface, match_surface, surface_target

RED, BLUE, CREAM = (np.array(color) for color in [(0.7, 0.1, 0.1), (0.1, 0.2, 0.7), (0.85, 0.8, 0.65)])


def sphere(paint: np.ndarray, gloss: float = 0.5, stops: float = 0.0) -> np.ndarray:
    """Pixels of a lit sphere, sRGB [n, 3], with highlights of a strength."""
    y, x = np.mgrid[1:-1:64j, -1:1:64j]
    inside = x * x + y * y < 0.95
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)[inside]
    light = np.array([0.4, 0.6, 0.7]) / np.linalg.norm([0.4, 0.6, 0.7])
    half = (light + [0, 0, 1]) / np.linalg.norm(light + [0, 0, 1])
    shading = 0.25 + 0.75 * np.maximum(normal @ light, 0)
    highlights = gloss * np.maximum(normal @ half, 0) ** 40
    colors = srgb_to_linear(paint) * shading[:, None] * 2.0**stops + highlights[:, None]
    return linear_to_srgb(np.clip(colors, 0, 1))


def palette_of(colors: np.ndarray, *paints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Black, the paints and white, and weights of colors of one of the paints and white."""
    palette = np.array([np.zeros(3), *paints, np.ones(3)], np.float32)
    weights = np.stack([_weights(color, palette) for color in colors])
    return palette, weights


def _weights(color: np.ndarray, palette: np.ndarray) -> np.ndarray:
    white = color.min()
    share = [np.clip((color - white) @ (p - p.min()) / ((p - p.min()) @ (p - p.min())), 0, 1) for p in palette[1:-1]]
    best = int(np.argmax([s * np.linalg.norm(p - p.min()) for s, p in zip(share, palette[1:-1], strict=True)]))
    weights = np.zeros(len(palette))
    weights[1 + best] = share[best]
    weights[-1] = max(0.0, white - share[best] * palette[1 + best].min())
    weights[0] = max(0.0, 1 - weights.sum())
    return weights


def after(colors, surfaces, paints=(RED,), locked=()):
    """Colors of an object with other surfaces, and its palettes before and after."""
    palette, weights = palette_of(colors, *paints)
    edited = match_surface(colors, np.ones(len(colors)), weights, palette, surfaces, locked)
    return np.clip(colors + weights @ (edited - palette), 0, 1), palette, edited


def difference(one, other):
    return float(ciede2000(srgb_to_lab(one), srgb_to_lab(other)).mean())


def test_neutral_values_keep_the_palettes_very_bits():
    _, palette, edited = after(sphere(RED), {1: Surface()})
    np.testing.assert_array_equal(edited, palette)
    assert Surface().is_neutral and not Surface(gloss=0.999).is_neutral


def test_no_saturation_is_gray_of_the_same_lightness():
    colors = sphere(RED)
    gray, _, _ = after(colors, {1: Surface(saturation=0)})
    lab, before = srgb_to_lab(gray), srgb_to_lab(colors)
    assert lab_chroma(lab).mean() < 2 < 40 < lab_chroma(before).mean()
    assert np.abs(lab[:, 0] - before[:, 0]).mean() < 2


def test_more_saturation_keeps_the_hue():
    colors = sphere(RED)
    vivid = surface_target(colors, np.ones(len(colors)), np.ones(len(colors)), Surface(saturation=1.2))
    before, lab = srgb_to_lab(colors), srgb_to_lab(vivid)
    assert lab_chroma(lab).mean() > lab_chroma(before).mean() + 3
    assert np.abs(lab[:, 0] - before[:, 0]).mean() < 2


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_gloss_is_that_of_a_sphere_with_such_highlights(factor):
    colors, wanted = sphere(RED, 0.5), sphere(RED, 0.5 * factor)
    target = surface_target(colors, np.ones(len(colors)), np.ones(len(colors)), Surface(gloss=factor))
    reached, _, _ = after(colors, {1: Surface(gloss=factor)})
    assert difference(target, wanted) < 0.5
    assert difference(reached, wanted) < 0.5 * difference(colors, wanted)


def test_matte_has_no_dark_spot_where_the_photo_cut_the_highlight_off():
    colors = sphere(RED, 1.5)  # white in its middle
    matte = surface_target(colors, np.ones(len(colors)), np.ones(len(colors)), Surface(gloss=0))
    middle = colors.min(axis=1) > 0.97
    assert middle.any()
    assert difference(matte[middle], sphere(RED, 0)[middle]) < 6


def test_brightness_lifts_what_lies_between_black_and_white():
    colors = sphere(RED, 0)
    lighter, _, _ = after(colors, {1: Surface(brightness=1)})
    darker, _, _ = after(colors, {1: Surface(brightness=-1)})
    assert srgb_to_lab(lighter)[:, 0].mean() > srgb_to_lab(colors)[:, 0].mean() + 3
    assert srgb_to_lab(darker)[:, 0].mean() < srgb_to_lab(colors)[:, 0].mean() - 3
    ends = np.array([[0.0, 0, 0], [1.0, 0.2, 0.2]])
    kept = surface_target(
        np.vstack([ends, colors]), np.ones(len(colors) + 2), np.ones(len(colors) + 2), Surface(0.999, 1)
    )
    np.testing.assert_allclose(kept[0], 0, atol=0.01)
    assert kept[1, 0] == pytest.approx(1, abs=0.02)


def test_another_paint_stays():
    blue = sphere(BLUE, 0)
    colors = np.vstack([sphere(RED, 0), blue])
    gray, _, edited = after(colors, {1: Surface(saturation=0)}, (RED, BLUE))
    assert difference(gray[-len(blue) :], blue) < 0.5
    np.testing.assert_allclose(edited[2], BLUE, atol=0.02)


def test_locked_swatches_stay():
    _, palette, edited = after(sphere(RED), {1: Surface(gloss=0)}, locked=[2])
    np.testing.assert_array_equal(edited[2], palette[2])


def test_two_swatches_of_one_paint_without_gloss_take_it_once():
    colors = sphere(RED)
    counts = gate = np.ones(len(colors))
    once = surface_target(colors, counts, gate, Surface(gloss=0))
    twice = surface_target(once, counts, gate, Surface(gloss=0))
    assert difference(once, twice) < 0.3


def test_a_paint_that_the_object_does_not_show_changes_nothing():
    colors = sphere(RED, 0)
    reached, _, _ = after(colors, {2: Surface(saturation=0)}, (RED, np.array([0.0, 1.0, 0.0])))
    np.testing.assert_allclose(reached, colors, atol=0.01)


@pytest.mark.parametrize("values", [{"saturation": -0.1}, {"gloss": 5}, {"brightness": 3}, {"gloss": float("nan")}])
def test_values_out_of_range_are_refused(values):
    with pytest.raises(BadRequest, match=next(iter(values))):
        Surface(**values)
    with pytest.raises(TypeError, match="gloss"):
        Surface(gloss="0")
