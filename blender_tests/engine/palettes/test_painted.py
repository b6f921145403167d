"""Swatches fitted to a painted view: against an edit that is known, in parts of the picture, and against nonsense."""

import numpy as np
import pytest

from karf_engine.errors import BadRequest
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.matching.painted import match_picture
from karf_engine.palettes.palette import MAX_SRGB, Palette

HEIGHT, WIDTH = 30, 40
POT = Palette("pot", np.array([[0, 0, 0], [0.8, 0.1, 0.1], [0.9, 0.9, 0.9]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.2, 0.6, 0.3], [0.8, 0.8, 0.5]], np.float32))
LEARNED = {palette.name: palette.colors for palette in (POT, MUG)}
BLUE_POT = {"pot": np.array([[0, 0, 0], [0.1, 0.2, 0.9], [1.0, 0.9, 0.9]], np.float32), "mug": MUG.colors}


@pytest.fixture
def view():
    """A pot in the left half, a mug in the right one, both shaded and glossy: weights, probabilities, base."""
    random = np.random.default_rng(3)
    probabilities = np.zeros((2, HEIGHT, WIDTH), np.float32)
    probabilities[0, :, : WIDTH // 2] = probabilities[1, :, WIDTH // 2 :] = 1
    shares = random.dirichlet([1, 3, 0.5], (HEIGHT, WIDTH)).astype(np.float32)
    weights = np.moveaxis(shares, -1, 0)[None] * probabilities[:, None]
    base = np.einsum("kmhw,kmc->hwc", weights, stacked(LEARNED))
    return weights, probabilities, np.clip(base + random.normal(0, 0.01, base.shape), 0, 1).astype(np.float32)


def stacked(colors):
    return stack_palettes(["pot", "mug"], colors)


def recolored(view, colors):
    return delta_composite(view[2], view[0], stacked(LEARNED), stacked(colors))


def matched(view, wanted, edited=LEARNED, **options):
    return {match.name: match for match in match_picture(*view, wanted, (POT, MUG), edited, **options)}


def test_the_picture_of_an_edit_gives_the_edit_back(view):
    found = matched(view, recolored(view, BLUE_POT))
    assert set(found) == {"pot"}
    np.testing.assert_allclose(found["pot"].colors, BLUE_POT["pot"], atol=0.02)
    assert found["pot"].before > 20 and found["pot"].after < 0.5 and found["pot"].painted > 0.9


def test_paint_on_a_small_part_speaks_for_the_whole_object(view):
    wanted = view[2].copy()
    wanted[8:14, 4:10] = recolored(view, BLUE_POT)[8:14, 4:10]
    found = matched(view, wanted)["pot"]
    np.testing.assert_allclose(found.colors, BLUE_POT["pot"], atol=0.06)
    assert found.painted == pytest.approx(36 / (HEIGHT * WIDTH / 2), rel=0.1)


def test_a_strange_brush_stroke_loses_its_say(view):
    wanted = recolored(view, BLUE_POT)
    wanted[:4, :18] = [1.0, 1.0, 0.0]
    np.testing.assert_allclose(matched(view, wanted)["pot"].colors[1], BLUE_POT["pot"][1], atol=0.06)


def test_an_object_that_only_reflects_the_new_color_stays(view):
    wanted = recolored(view, BLUE_POT)
    wanted[10:20, -12:] += [-0.04, 0.0, 0.08]
    assert set(matched(view, wanted.clip(0, 1))) == {"pot"}
    wanted[10:20, -12:] = [0.9, 0.1, 0.9]  # which is paint
    assert set(matched(view, wanted)) == {"pot", "mug"}


def test_it_goes_on_from_the_edit_that_was_painted_on(view):
    green_mug = BLUE_POT | {"mug": np.array([[0, 0, 0], [0.6, 0.1, 0.3], [0.8, 0.8, 0.5]], np.float32)}
    found = matched(view, recolored(view, green_mug), BLUE_POT)
    assert set(found) == {"mug"}
    np.testing.assert_allclose(found["mug"].colors, green_mug["mug"], atol=0.02)


def test_what_the_picture_clips_bounds_no_swatch(view):
    bright = LEARNED | {"pot": np.array([[0, 0, 0], [1.6, 1.2, 0.1], [1.9, 1.9, 1.9]], np.float32)}
    found = matched(view, recolored(view, bright))["pot"]
    assert found.after < 1 and found.before > 50 and found.colors.max() <= MAX_SRGB
    np.testing.assert_allclose(found.colors[1], bright["pot"][1], atol=0.1)


def test_rounding_to_8_bits_is_no_paint(view):
    assert matched(view, np.rint(view[2] * 255) / 255) == {}


def test_paint_beside_the_objects_changes_nothing(view):
    weights, probabilities, base = view
    probabilities[0, :, :10], weights[0, :, :, :10] = 0, 0
    wanted = base.copy()
    wanted[:, :10] = [0, 0, 1]
    assert matched(view, wanted) == {}


def test_a_picture_of_another_size_is_refused(view):
    with pytest.raises(BadRequest, match="20 x 30 pixels, the view 40 x 30"):
        matched(view, view[2][:, :20])
