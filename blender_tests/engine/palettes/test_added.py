"""Colors added to an object: what they change, what they leave alone, and their files."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from karf_engine.errors import BadRequest, DataError
from karf_engine.export.scene_points import ScenePoints
from karf_engine.io.color import linear_to_srgb, srgb_to_linear
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.added import (
    append_added_sets,
    extended_palettes,
    match_added_color,
    pigment_of_swatch,
    propose_added_color,
    split_weights,
    split_weights_of_objects,
)
from karf_engine.palettes.color_histogram import ColorHistogram
from karf_engine.palettes.compositing import delta_composite, paper_composite
from karf_engine.palettes.matching.becomes import match_becomes
from karf_engine.palettes.matching.paints import pigment_gate
from karf_engine.palettes.palette import PROTECT, AddedColor, Edit, Palette, read_edit, write_edit
from karf_engine.palettes.palette_files import write_edit_file
from karf_engine.palettes.palette_weights import star_weights

PALETTE = np.array([[0, 0, 0], [0.95, 0.1, 0.1], [0.1, 0.1, 0.95], [1, 1, 0.95]], np.float32)
RED, VIOLET, GREEN = np.array([0.8, 0.15, 0.15]), np.array([0.5, 0.2, 0.6]), np.array([0.2, 0.6, 0.25])


def lit(pigment):
    """A strip of an object of this pigment, from the shade to the light, sRGB [20, 3]."""
    return linear_to_srgb(np.linspace(0.1, 1, 20)[:, None] * srgb_to_linear(pigment))


@pytest.fixture
def stripes():
    """Of an object of two pigments: its picture [2, 20, 3], weights [4, 2, 20], and what is seen of it."""
    picture = np.stack([lit(RED), lit(VIOLET)]).astype(np.float32)
    weights = star_weights(picture.reshape(-1, 3), PALETTE)
    seen = ColorHistogram(picture.reshape(-1, 3), np.ones(40), weights)
    return picture, weights.T.reshape(4, 2, 20), seen


def recolored(stripes, added, edited):
    picture, weights, _ = stripes
    learned = append_added_sets(PALETTE, added)
    return delta_composite(picture, split_weights(weights, PALETTE, added)[None], learned[None], edited[None])


def edited_with(stripes, color, wanted, palette=PALETTE):
    return np.concatenate([palette, match_added_color(stripes[2], PALETTE, color, wanted)])


def test_without_added_colors_all_is_the_same_array(stripes):
    planes = stripes[1][None]
    assert split_weights_of_objects(planes, [Palette("pot", PALETTE)], {}) is planes
    assert split_weights(stripes[1], PALETTE, ()) is stripes[1]
    np.testing.assert_array_equal(append_added_sets(PALETTE, ()), PALETTE)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_the_parts_of_a_weight_add_up_to_its_very_bits(kind):
    weights = np.random.default_rng(1).dirichlet(np.ones(len(PALETTE)), 500).T.astype(kind)
    shares = split_weights(weights, PALETTE, [AddedColor(VIOLET), AddedColor(RED, 0.5)])
    assert (shares >= 0).all() and (shares[4:] > 0).any()
    parts = shares.reshape(3, *weights.shape).astype(np.float64)
    np.testing.assert_array_equal(parts[:, 1:].sum(0), weights[1:].astype(np.float64))


def test_weights_are_only_dealt_out_anew(stripes):
    shares = split_weights(stripes[1], PALETTE, [AddedColor(VIOLET), AddedColor(RED, 0.5)])
    assert shares.shape == (12, 2, 20) and (shares >= 0).all()
    np.testing.assert_allclose(shares.sum(0), stripes[1].sum(0), atol=1e-6)
    joined = np.stack([shares[j::4].sum(0) for j in range(4)])  # the picked colors' own are 0
    np.testing.assert_allclose(joined, stripes[1], atol=1e-6)


def test_a_picked_color_that_stays_changes_no_bit(stripes):
    color = AddedColor(VIOLET.astype(np.float32))
    edited = edited_with(stripes, color, color.picked)
    np.testing.assert_array_equal(edited, append_added_sets(PALETTE, [color]))
    np.testing.assert_array_equal(recolored(stripes, [color], edited), stripes[0])


def test_only_the_picked_pigment_changes_and_becomes_what_is_wanted(stripes):
    color = AddedColor(VIOLET)
    red, violet = recolored(stripes, [color], edited_with(stripes, color, GREEN))
    np.testing.assert_allclose(red, lit(RED), atol=1e-3)
    assert mean_ciede2000(violet, lit(GREEN)) < 2.5
    np.testing.assert_allclose(violet[-1], GREEN, atol=0.02)
    # the swatches alone cannot do that: they make up the red too
    becomes = match_becomes(*stripes[2], PALETTE, VIOLET, GREEN)
    plain = delta_composite(stripes[0], stripes[1][None], PALETTE[None], becomes[None])
    assert np.abs(plain[0] - lit(RED)).max() > 0.1


def test_swatches_no_longer_move_the_picked_pigment(stripes):
    color, palette = AddedColor(VIOLET), PALETTE.copy()
    palette[1] = [0.9, 0.8, 0.1]
    red, violet = recolored(stripes, [color], edited_with(stripes, color, VIOLET, palette))
    np.testing.assert_allclose(violet, lit(VIOLET), atol=2e-3)
    assert np.abs(red - lit(RED)).max() > 0.3


def test_reach_says_how_far_in_hue_the_pigment_goes(stripes):
    near = split_weights(stripes[1], PALETTE, [AddedColor(VIOLET, 0.2)])[4:].sum()
    far = split_weights(stripes[1], PALETTE, [AddedColor(VIOLET, 4.0)])[4:].sum()
    assert far > 1.5 * near > 0


def test_a_grey_pigment_is_told_by_its_chroma():
    grey = np.full(3, 0.6)
    colors = np.concatenate([lit(grey), lit(RED)]).astype(np.float32)
    shares = split_weights(star_weights(colors, PALETTE).T, PALETTE, [AddedColor(grey)])[4:].sum(0)
    assert shares[:20].min() > 0.05 and shares[30:].max() < 1e-3


def test_the_palette_alone_is_recolored_too(stripes):
    picture, weights, _ = stripes
    color = AddedColor(VIOLET)
    shares, edited = split_weights(weights, PALETTE, [color])[None], edited_with(stripes, color, GREEN)[None]
    red, violet = paper_composite(0 * picture, shares, np.ones((1, 2, 20)), edited)
    np.testing.assert_allclose(red, lit(RED), atol=5e-3)
    assert mean_ciede2000(violet, lit(GREEN)) < 2.5


def test_objects_of_different_palettes_stand_side_by_side(stripes):
    _, weights, _ = stripes
    palettes = [Palette("pot", PALETTE[:2]), Palette("mug", PALETTE)]
    planes = np.stack([weights, weights])
    planes[0, 2:] = 0
    added = {"pot": [AddedColor(RED)]}
    shares = split_weights_of_objects(planes, palettes, added)
    assert [len(each.colors) for each in extended_palettes(palettes, added)] == [4, 4]
    assert shares.shape == (2, 4, 2, 20)
    np.testing.assert_array_equal(shares[1], weights)
    np.testing.assert_allclose(shares[0].sum(0), planes[0].sum(0), atol=1e-6)


def test_points_are_recolored_as_pictures_are(stripes):
    picture, weights, _ = stripes
    n, color = 40, AddedColor(VIOLET)
    none, colors = np.zeros((n, 3), np.float32), np.rint(picture.reshape(-1, 3) * 255).astype(np.uint8)
    own = weights.reshape(4, 1, n).transpose(2, 1, 0)
    points = ScenePoints(("pot",), none, none, none[:, 0], colors, np.ones((n, 1)), own, PALETTE[None])
    edited = edited_with(stripes, color, GREEN)
    found = points.with_added([Palette("pot", PALETTE)], {"pot": [color]}).recolored(edited[None])
    np.testing.assert_allclose(found.reshape(2, 20, 3), recolored(stripes, [color], edited), atol=1 / 255)


# --- files ---------------------------------------------------------------------------------------------------------
@pytest.fixture
def edit(stripes):
    color = AddedColor(VIOLET.astype(np.float32), 0.75)
    return Edit({"pot": edited_with(stripes, color, GREEN)}, "paper", {"pot": (color,)})


def test_an_edit_comes_back_with_its_added_colors(edit, tmp_path):
    write_edit(tmp_path / "edit.json", edit)
    again = read_edit(tmp_path / "edit.json", [Palette("pot", PALETTE)])
    np.testing.assert_array_equal(again.colors["pot"], edit.colors["pot"])
    (found,), (color,) = again.added["pot"], edit.added["pot"]
    np.testing.assert_array_equal(found.picked, color.picked)
    assert (found.reach, again.compositing) == (0.75, "paper")


def test_an_edit_without_added_colors_has_the_file_that_it_had(edit, tmp_path):
    write_edit(tmp_path / "edit.json", replace(edit, colors={"pot": PALETTE}, added={}))
    assert "added" not in (tmp_path / "edit.json").read_text()


@pytest.mark.parametrize("suffix", [".gpl", ".ase"])
def test_a_palette_file_refuses_added_colors(edit, suffix, tmp_path):
    with pytest.raises(BadRequest, match="cannot hold the colors that were added to pot"):
        write_edit_file(tmp_path / f"pots{suffix}", edit)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"added": {}}, "is not a list"),
        ({"added": ["#ff0000"]}, "has the added color '#ff0000'"),
        ({"added": [{"picked": "#ff0000", "colors": ["#000000"]}]}, "of 1 colors, its palette has 4"),
        ({"added": [{"picked": "red", "colors": ["#000000"] * 4}]}, "is not a color"),
        ({"added": [{"picked": "#ff0000", "reach": 0, "colors": ["#000000"] * 4}]}, "has the reach 0"),
        ({"added": [{"picked": "#ff0000"}]}, "is not a list"),
        ({"added": [{"picked": "#ff0000", "colors": ["#000000"] * 4}] * 17}, "is not a list of 1 to 16"),
    ],
)
def test_what_is_no_added_color_is_told(wrong, sentence, tmp_path):
    entry = {"colors": [None] * 4} | wrong
    (tmp_path / "edit.json").write_text(json.dumps({"schema": "karf-edit/1", "objects": {"pot": entry}}))
    with pytest.raises(DataError, match=sentence):
        read_edit(tmp_path / "edit.json", [Palette("pot", PALETTE)])


def test_black_has_no_pigment(stripes):
    with pytest.raises(BadRequest, match="source color is black"):
        match_added_color(stripes[2], PALETTE, AddedColor(np.zeros(3)), GREEN)


def lettered(share_of_silver=0.5):
    """What is seen of a silver thing with red letters: lit from the shade to the light, its silver mirroring a warm room."""
    silver = linear_to_srgb(np.linspace(0.1, 1, 20)[:, None] * srgb_to_linear(np.array([0.78, 0.75, 0.73])))
    picture = np.concatenate([lit(RED), silver]).astype(np.float32)
    counts = np.repeat([1 - share_of_silver, share_of_silver], 20)
    return ColorHistogram(picture, counts, star_weights(picture, PALETTE))


def test_protected_neutrals_stay_where_hue_alone_would_take_them():
    seen = lettered()
    change = {}
    for protect in (0.0, 0.2):
        color = AddedColor(RED, 0.75, protect)
        edited = np.concatenate([PALETTE, match_added_color(seen, PALETTE, color, GREEN)])
        shares = split_weights(seen.palette_weights.T, PALETTE, [color]).T
        change[protect] = mean_ciede2000(
            seen.colors, seen.colors + shares @ (edited - append_added_sets(PALETTE, [color]))
        )
        letters = (seen.colors + shares @ (edited - append_added_sets(PALETTE, [color])))[:20]
        assert mean_ciede2000(letters, lit(GREEN)) < 2.5
        silver = (shares @ (edited - append_added_sets(PALETTE, [color])))[20:]
        assert (np.abs(silver).max() < 1e-6) == bool(protect)
    assert change[0.2] < change[0.0]


def test_colors_become_the_pigment_gradually_where_letters_fade_into_silver():
    fade = np.linspace(0, 1, 200)[:, None] * (RED - 0.7) + 0.7
    gate = pigment_gate(fade, RED, 0.75, 0.2)
    assert (np.diff(gate) > -1e-9).all() and gate[0] == 0 and gate[-1] > 0.99 and np.diff(gate).max() < 0.05


def test_the_objects_colors_propose_what_is_protected():
    assert propose_added_color(lettered(0.5), RED).protect == PROTECT
    assert propose_added_color(lettered(0.01), RED).protect == 0.0  # these are highlights


def test_a_grey_that_is_picked_has_no_hue_to_propose_by():
    color = propose_added_color(lettered(), np.full(3, 0.6))
    assert (color.reach, color.protect) == (AddedColor(RED).reach, 0.0)


def test_a_proposed_reach_ends_before_the_next_pigment():
    seen = ColorHistogram(np.concatenate([lit(RED), lit(np.array([0.7, 0.35, 0.1]))]), np.ones(40), np.ones((40, 1)))
    alone = ColorHistogram(lit(RED), np.ones(20), np.ones((20, 1)))
    color = propose_added_color(seen, RED)
    assert propose_added_color(alone, RED).reach == pytest.approx(0.75)
    assert pigment_gate(seen.colors[20:], RED, color.reach).max() < 0.1 < pigment_gate(seen.colors[20:], RED, 1).max()


def test_a_swatch_knows_the_pigment_that_it_paints():
    seen = lettered()
    index = int(np.linalg.norm(PALETTE - RED, axis=1).argmin())
    assert mean_ciede2000(pigment_of_swatch(seen, index)[None], RED[None]) < 10


@pytest.mark.parametrize("value", [-0.1, 0.6, "0.2", None, True])
def test_what_cannot_be_protected_is_refused_by_name(tmp_path, value):
    edit = {"colors": [None] * 4, "added": [{"picked": "#802020", "protect": value, "colors": [[0, 0, 0]] * 4}]}
    (tmp_path / "edit.json").write_text(json.dumps({"schema": "karf-edit/1", "objects": {"pot": edit}}))
    with pytest.raises(DataError, match="protects"):
        read_edit(tmp_path / "edit.json", [Palette("pot", PALETTE)])


def test_what_is_protected_is_kept_in_the_file(tmp_path):
    colors = {"pot": append_added_sets(PALETTE, [AddedColor(RED), AddedColor(VIOLET)])}
    edit = Edit(colors, added={"pot": (AddedColor(RED, 0.5, 0.25), AddedColor(VIOLET, 0.5))})
    write_edit(tmp_path / "edit.json", edit)
    again = read_edit(tmp_path / "edit.json", [Palette("pot", PALETTE)])
    assert [each.protect for each in again.added["pot"]] == [0.25, 0.0]
    added = json.loads((tmp_path / "edit.json").read_text())["objects"]["pot"]["added"]
    assert ["protect" in each for each in added] == [True, False]
