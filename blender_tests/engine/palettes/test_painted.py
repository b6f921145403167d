"""Swatches fitted to a painted view of a known edit."""

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
BLUE_POT = LEARNED | {"pot": np.array([[0, 0, 0], [0.1, 0.2, 0.9], [1.0, 0.9, 0.9]], np.float32)}
BRIGHT_POT = LEARNED | {"pot": np.array([[0, 0, 0], [1.6, 1.2, 0.1], [1.9, 1.9, 1.9]], np.float32)}
PINK_MUG = BLUE_POT | {"mug": np.array([[0, 0, 0], [0.6, 0.1, 0.3], [0.8, 0.8, 0.5]], np.float32)}

# a pot left of the middle, a mug in the right half, both shaded and glossy
RANDOM = np.random.default_rng(3)
PROBABILITIES = np.zeros((2, HEIGHT, WIDTH), np.float32)
PROBABILITIES[0, :, 4 : WIDTH // 2] = PROBABILITIES[1, :, WIDTH // 2 :] = 1
SHARES = RANDOM.dirichlet([1, 3, 0.5], (HEIGHT, WIDTH)).astype(np.float32)
WEIGHTS = np.moveaxis(SHARES, -1, 0)[None] * PROBABILITIES[:, None]
BASE = np.einsum("kmhw,kmc->hwc", WEIGHTS, np.stack([POT.colors, MUG.colors]))
BASE = np.clip(BASE + RANDOM.normal(0, 0.01, BASE.shape), 0, 1).astype(np.float32)
SPOT = np.s_[8:14], np.s_[4:10]
REFLECTION = np.s_[10:20], np.s_[-12:]


def recolored(colors, rows=np.s_[:], columns=np.s_[:], paint=None):
    """The view with other swatches; a paint covers a part of it."""
    picture = delta_composite(BASE, WEIGHTS, *(stack_palettes(["pot", "mug"], each) for each in (LEARNED, colors)))
    if paint is not None:
        picture[rows, columns] = paint
    return picture


def match(wanted, edited=LEARNED):
    return {each.name: each for each in match_picture(WEIGHTS, PROBABILITIES, BASE, wanted, (POT, MUG), edited)}


@pytest.mark.parametrize(
    ("wanted", "edited", "names", "expected", "tolerance"),
    [
        (recolored(BLUE_POT), LEARNED, {"pot"}, BLUE_POT, 0.02),
        (recolored(PINK_MUG), BLUE_POT, {"mug"}, PINK_MUG, 0.02),  # starts at the edit that was painted on
        (recolored(LEARNED, *SPOT, recolored(BLUE_POT)[SPOT]), LEARNED, {"pot"}, BLUE_POT, 0.06),
        # a mug that reflects the new color stays; the magenta is paint
        (recolored(BLUE_POT, *REFLECTION, recolored(BLUE_POT)[REFLECTION] + [-0.04, 0.0, 0.08]), LEARNED, {"pot"},
         BLUE_POT, 0.02),
        (recolored(BLUE_POT, *REFLECTION, [0.9, 0.1, 0.9]), LEARNED, {"pot", "mug"}, {}, 0),
        (np.rint(BASE * 255) / 255, LEARNED, set(), {}, 0),
        (recolored(LEARNED, np.s_[:], np.s_[:4], [0, 0, 1]), LEARNED, set(), {}, 0),  # beside the objects
    ],
    ids=["an edit", "another", "a spot", "reflected", "painted too", "rounded", "beside"],
)  # fmt: skip
def test_painted_edit_is_recovered(wanted, edited, names, expected, tolerance):
    found = match(wanted.clip(0, 1), edited)
    assert set(found) == names
    for name in names & set(expected):
        np.testing.assert_allclose(found[name].colors, expected[name], atol=tolerance)


def test_match_reports_differences_and_the_painted_share():
    whole = match(recolored(BLUE_POT))["pot"]
    spot = match(recolored(LEARNED, *SPOT, recolored(BLUE_POT)[SPOT]))["pot"]
    assert whole.before > 20 and whole.after < 0.5 and whole.painted > 0.9
    assert spot.painted == pytest.approx(36 / (HEIGHT * 16), rel=0.1)


def test_clipped_pixels_do_not_bound_swatches():
    found = match(recolored(BRIGHT_POT))["pot"]
    assert found.before > 50 and found.after < 1 and found.colors.max() <= MAX_SRGB
    np.testing.assert_allclose(found.colors[1], BRIGHT_POT["pot"][1], atol=0.1)


def test_outlier_brush_stroke_has_little_influence():
    found = match(recolored(BLUE_POT, np.s_[:4], np.s_[4:18], [1.0, 1.0, 0.0]))["pot"]
    np.testing.assert_allclose(found.colors[1], BLUE_POT["pot"][1], atol=0.06)


def test_picture_of_another_size_is_rejected():
    with pytest.raises(BadRequest, match="20 x 30 pixels, the view 40 x 30"):
        match(BASE[:, :20])
