"""Every kind of palette edit, on several palettes."""

import numpy as np
import pytest

from blender_tests.engine.palettes.conftest import BLUE, GREEN, LEGO, VIOLET, histogram_of, lit, recolor
from karf_engine.palettes.added import append_added_sets, match_added_color
from karf_engine.palettes.matching.becomes import match_becomes, match_dragged, match_fewest, nearest_weights
from karf_engine.palettes.matching.fitting import match_perceptually, match_pixels
from karf_engine.palettes.matching.painted import match_picture
from karf_engine.palettes.matching.surface import Surface, match_surface
from karf_engine.palettes.palette import MAX_SRGB, AddedColor, Palette

PINK = np.array([0.75, 0.2, 0.2])  # in darker channels a metal's reflection would be noise
PALETTES = {
    "two swatches": [[0, 0, 0], [0.85, 0.1, 0.12], [0.2, 0.25, 0.9]],
    "tetrahedron": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "of toys": LEGO[[0, 4, 3, 1, 2, 5]],
    "beyond white": [[0, 0, 0], [1.4, 0.1, 0.1], [0.2, 0.2, 1.6], [1.2, 1.2, 1.2]],
}


def becomes(seen, palette, is_changed, locked, **options):
    return match_becomes(*seen, palette, PINK, GREEN if is_changed else PINK, locked, **options)


def becomes_metal(seen, palette, is_changed, locked):
    return becomes(seen, palette, is_changed, locked, is_metal=True)


def becomes_pair(seen, palette, is_changed, locked):
    sources = np.stack([PINK, BLUE])
    return match_becomes(*seen, palette, sources, np.stack([GREEN, VIOLET]) if is_changed else sources, locked)


def drag(seen, palette, is_changed, locked):
    color = np.float32([0.1, 0.6, 0.3]) if is_changed else palette[1]
    return match_dragged(*seen, palette, 1, color, locked)


def fewest(seen, palette, is_changed, locked):
    weights = nearest_weights(seen.colors, seen.palette_weights, PINK)
    return match_fewest(weights, palette, GREEN if is_changed else PINK, locked, shown=PINK)


def surface(seen, palette, is_changed, locked):
    return match_surface(*seen, palette, {1: Surface(saturation=0.2, gloss=0.5) if is_changed else Surface()}, locked)


def fit_pixels(seen, palette, is_changed, locked, match=match_pixels):
    targets = seen.colors[:, [1, 2, 0]] if is_changed else seen.colors
    return match(seen.palette_weights, seen.colors, targets, palette, seen.counts, locked)


def fit_perceptually(seen, palette, is_changed, locked):
    return fit_pixels(seen, palette, is_changed, locked, match_perceptually)


def paint_picture(seen, palette, is_changed, locked):
    learned = np.clip(palette, 0, 1)
    base, planes = seen.colors[None].astype(np.float32), seen.palette_weights.T[None, :, None]
    wanted = recolor(seen, learned, palette)[None].astype(np.float32)
    wanted = wanted[..., [1, 2, 0]] if is_changed else wanted
    objects = [Palette("pot", learned)]
    found = match_picture(planes, planes.sum(1), base, wanted, objects, {"pot": palette}, {"pot": locked})
    return found[0].colors if found else palette


EDITS = [becomes, becomes_metal, becomes_pair, drag, fewest, surface, fit_pixels, fit_perceptually, paint_picture]


@pytest.fixture(params=PALETTES)
def palette(request):
    return np.array(PALETTES[request.param], np.float32)


@pytest.fixture
def seen(palette):
    """An object of two paints."""
    return histogram_of(np.concatenate([lit(PINK), lit(BLUE)]).astype(np.float32), np.clip(palette, 0, 1))


@pytest.mark.parametrize("edit", EDITS)
def test_edit_without_change_keeps_every_bit(edit, seen, palette):
    np.testing.assert_array_equal(edit(seen, palette, False, ()), palette)


@pytest.mark.parametrize("edit", EDITS)
def test_edit_keeps_black_and_locked_swatches_and_the_color_range(edit, seen, palette):
    for locked in ((), (2,)):
        edited = edit(seen, palette, True, locked)
        assert edited.shape == palette.shape and edited.dtype == np.float32
        np.testing.assert_array_equal(edited[[0, *locked]], palette[[0, *locked]])
        assert (edited != palette).any()
        assert edited.min() >= 0 and edited.max() <= MAX_SRGB


@pytest.mark.parametrize("protect", [0.0, 0.2])
@pytest.mark.parametrize("wanted", [PINK, GREEN])
def test_added_color_starts_at_its_target_and_an_unmoved_one_changes_no_bit(seen, palette, wanted, protect):
    color = AddedColor(np.float32(PINK), protect=protect)
    edited = match_added_color(seen, palette, color, np.float32(wanted))
    np.testing.assert_array_equal(edited[0], np.float32(wanted))
    is_same = np.array_equal([*palette, *edited], append_added_sets(palette, [color]))
    assert is_same == (wanted is PINK) and edited.dtype == np.float32
    assert edited.min() >= 0 and edited.max() <= MAX_SRGB
