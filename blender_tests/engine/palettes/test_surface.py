"""Saturation, brightness and gloss of a paint on a sphere whose true look is known."""

import numpy as np
import pytest

from blender_tests.engine.palettes.conftest import BLUE, RED, glossy_sphere, histogram_of, recolor
from karf_engine.errors import BadRequest
from karf_engine.io.color import lab_chroma, srgb_to_lab
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.matching.surface import Surface, match_surface, surface_target


def apply_surfaces(colors, surfaces, *paints):
    """The colors of a glossy object after its surfaces change, and its edited palette."""
    palette = np.array([np.zeros(3), *(paints or (RED,)), np.ones(3)], np.float32)
    seen = histogram_of(colors, palette)
    edited = match_surface(*seen, palette, surfaces)
    return recolor(seen, palette, edited), edited


def full_target(colors, surface):
    """The target colors if every pixel has the paint."""
    everywhere = np.ones(len(colors))
    return surface_target(colors, everywhere, everywhere, surface)


def lightness(colors):
    return srgb_to_lab(colors)[:, 0]


def test_saturation_changes_chroma_and_keeps_lightness():
    colors = glossy_sphere(RED)
    gray, _ = apply_surfaces(colors, {1: Surface(saturation=0)})
    before, vivid = lab_chroma(srgb_to_lab(colors)).mean(), full_target(colors, Surface(saturation=1.2))
    assert lab_chroma(srgb_to_lab(gray)).mean() < 2 < 40 < before
    assert lab_chroma(srgb_to_lab(vivid)).mean() > before + 3
    for each in (gray, vivid):
        assert np.abs(lightness(each) - lightness(colors)).mean() < 2


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.5])
def test_gloss_factor_scales_the_highlights(factor):
    colors, wanted = glossy_sphere(RED, 0.5), glossy_sphere(RED, 0.5 * factor)
    reached, _ = apply_surfaces(colors, {1: Surface(gloss=factor)})
    assert mean_ciede2000(full_target(colors, Surface(gloss=factor)), wanted) < 0.5
    assert mean_ciede2000(reached, wanted) < 0.5 * mean_ciede2000(colors, wanted)


def test_matte_leaves_no_dark_spot_at_clipped_highlights():
    colors = glossy_sphere(RED, 1.5)  # white in its middle
    middle = colors.min(axis=1) > 0.97
    assert middle.any()
    assert mean_ciede2000(full_target(colors, Surface(gloss=0)), glossy_sphere(RED, 0), middle) < 6


def test_brightness_changes_midtones_and_keeps_black_and_white():
    colors = glossy_sphere(RED, 0)
    (lighter, _), (darker, _) = (apply_surfaces(colors, {1: Surface(brightness=stops)}) for stops in (1, -1))
    assert lightness(darker).mean() + 3 < lightness(colors).mean() < lightness(lighter).mean() - 3
    kept = full_target(np.vstack([np.zeros(3), [1.0, 0.2, 0.2], colors]), Surface(0.999, 1))
    np.testing.assert_allclose(kept[0], 0, atol=0.01)
    assert kept[1, 0] == pytest.approx(1, abs=0.02)


def test_other_paints_stay():
    red, blue = glossy_sphere(RED, 0), glossy_sphere(BLUE, 0)
    gray, edited = apply_surfaces(np.vstack([red, blue]), {1: Surface(saturation=0)}, RED, BLUE)
    assert mean_ciede2000(gray[len(red) :], blue) < 0.5
    np.testing.assert_allclose(edited[2], BLUE, atol=0.02)


def test_absent_paint_changes_nothing_and_matte_stays_matte():
    colors = glossy_sphere(RED, 0)
    reached, _ = apply_surfaces(colors, {2: Surface(saturation=0)}, RED, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(reached, colors, atol=0.01)
    once = full_target(glossy_sphere(RED), Surface(gloss=0))
    assert mean_ciede2000(once, full_target(once, Surface(gloss=0))) < 0.3


@pytest.mark.parametrize(
    ("name", "value"), [("saturation", -0.1), ("gloss", 5), ("brightness", 3), ("gloss", np.nan), ("gloss", "0")]
)
def test_out_of_range_values_are_rejected(name, value):
    with pytest.raises(TypeError if value == "0" else BadRequest, match=name):
        Surface(**{name: value})
