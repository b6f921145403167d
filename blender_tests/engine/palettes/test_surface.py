"""Saturation, brightness and gloss of a paint: against a sphere whose true look is known, and what must not change."""

import numpy as np
import pytest

from blender_tests.engine.palettes.conftest import BLUE, RED, glossy_sphere, seen_of, shown
from karf_engine.errors import BadRequest
from karf_engine.io.color import lab_chroma, srgb_to_lab
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.matching.surface import Surface, match_surface, surface_target


def after(colors, surfaces, *paints):
    """Colors of an object of paints and gloss with other surfaces, and its edited palette."""
    palette = np.array([np.zeros(3), *(paints or (RED,)), np.ones(3)], np.float32)
    seen = seen_of(colors, palette)
    edited = match_surface(*seen, palette, surfaces)
    return shown(seen, palette, edited), edited


def target_of(colors, surface):
    """The colors wanted where all of them are of the paint."""
    everywhere = np.ones(len(colors))
    return surface_target(colors, everywhere, everywhere, surface)


def lightness(colors):
    return srgb_to_lab(colors)[:, 0]


def test_no_saturation_is_gray_more_is_vivid_and_both_keep_the_lightness():
    colors = glossy_sphere(RED)
    gray, _ = after(colors, {1: Surface(saturation=0)})
    before, vivid = lab_chroma(srgb_to_lab(colors)).mean(), target_of(colors, Surface(saturation=1.2))
    assert lab_chroma(srgb_to_lab(gray)).mean() < 2 < 40 < before
    assert lab_chroma(srgb_to_lab(vivid)).mean() > before + 3
    for each in (gray, vivid):
        assert np.abs(lightness(each) - lightness(colors)).mean() < 2


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_gloss_is_that_of_a_sphere_with_such_highlights(factor):
    colors, wanted = glossy_sphere(RED, 0.5), glossy_sphere(RED, 0.5 * factor)
    reached, _ = after(colors, {1: Surface(gloss=factor)})
    assert mean_ciede2000(target_of(colors, Surface(gloss=factor)), wanted) < 0.5
    assert mean_ciede2000(reached, wanted) < 0.5 * mean_ciede2000(colors, wanted)


def test_matte_has_no_dark_spot_where_the_photo_cut_the_highlight_off():
    colors = glossy_sphere(RED, 1.5)  # white in its middle
    middle = colors.min(axis=1) > 0.97
    assert middle.any()
    assert mean_ciede2000(target_of(colors, Surface(gloss=0)), glossy_sphere(RED, 0), middle) < 6


def test_brightness_lifts_what_lies_between_black_and_white():
    colors = glossy_sphere(RED, 0)
    (lighter, _), (darker, _) = (after(colors, {1: Surface(brightness=stops)}) for stops in (1, -1))
    assert lightness(darker).mean() + 3 < lightness(colors).mean() < lightness(lighter).mean() - 3
    kept = target_of(np.vstack([np.zeros(3), [1.0, 0.2, 0.2], colors]), Surface(0.999, 1))
    np.testing.assert_allclose(kept[0], 0, atol=0.01)
    assert kept[1, 0] == pytest.approx(1, abs=0.02)


def test_another_paint_stays():
    red, blue = glossy_sphere(RED, 0), glossy_sphere(BLUE, 0)
    gray, edited = after(np.vstack([red, blue]), {1: Surface(saturation=0)}, RED, BLUE)
    assert mean_ciede2000(gray[len(red) :], blue) < 0.5
    np.testing.assert_allclose(edited[2], BLUE, atol=0.02)


def test_a_paint_that_the_object_does_not_show_changes_nothing_and_matte_stays_matte():
    colors = glossy_sphere(RED, 0)
    reached, _ = after(colors, {2: Surface(saturation=0)}, RED, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(reached, colors, atol=0.01)
    once = target_of(glossy_sphere(RED), Surface(gloss=0))
    assert mean_ciede2000(once, target_of(once, Surface(gloss=0))) < 0.3


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({"saturation": -0.1}, BadRequest),
        ({"gloss": 5}, BadRequest),
        ({"brightness": 3}, BadRequest),
        ({"gloss": float("nan")}, BadRequest),
        ({"gloss": "0"}, TypeError),
    ],
)
def test_values_out_of_range_are_refused(values, error):
    with pytest.raises(error, match=next(iter(values))):
        Surface(**values)
