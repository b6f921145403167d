"""The judge of thin parts: what it counts as thin, as held and as wrong paint, and what it takes for truth."""

import numpy as np
import pytest

from karf_engine.io.files import write_json
from karf_engine.io.images import write_png
from tools.judging.thin_parts import Counts, count, crop_of, mean_of, share, without_nan
from tools.judging.thin_truth import ThinPart, thin_part
from tools.judging.truth import THIN_RAYS, Truth

SIZE = 40
ROWS, COLUMNS = np.indices((SIZE, SIZE))
ROD = (COLUMNS >= 20) & (COLUMNS < 23) & (ROWS < 30)


def rays_of(mask):
    """Rays through the pixels of a mask."""
    return np.repeat(np.repeat(mask, THIN_RAYS, 0), THIN_RAYS, 1)


@pytest.fixture
def part():
    return thin_part(rays_of(ROD))


def test_a_slanted_wire_is_as_wide_as_it_is():
    rows, columns = np.indices((SIZE * THIN_RAYS,) * 2) / THIN_RAYS
    across = np.abs(columns - rows) / np.sqrt(2)
    wide, narrow, hair = (thin_part(across < 0.5 * width) for width in (2.6, 1.4, 0.5))
    assert wide.wide.any() and not wide.narrow[3:-3, 3:-3].any()
    assert narrow.narrow.any() and not narrow.wide.any()
    assert not hair.pixels.any()


def test_all_of_a_rod_is_held_by_its_own_mask_and_nothing_by_none(part):
    assert (part.pixels == ROD).all() and not part.narrow.any()
    best, none = (count(held, ROD, part) for held in (ROD, np.zeros_like(ROD)))
    assert (best.wide_held, best.painted, best.painted_right) == (90, 90, 90)
    assert (none.wide_held, none.painted) == (0, 0)


def test_paint_beside_a_rod_counts_against_it_and_paint_elsewhere_does_not(part):
    beside = ROD | ((COLUMNS >= 23) & (COLUMNS < 26) & (ROWS < 30))
    elsewhere = ROD | (COLUMNS < 10)
    assert count(beside, ROD, part).painted == 180 and count(beside, ROD, part).painted_right == 90
    assert count(elsewhere, ROD, part).painted == 90


def test_counts_of_views_are_added_and_too_few_pixels_tell_nothing():
    assert Counts(1, 2, 3, 4, 5, 6) + Counts(1, 1, 1, 1, 1, 1) == Counts(2, 3, 4, 5, 6, 7)
    assert share(45, 90) == 0.5 and np.isnan(share(5, 10))


def test_what_was_not_there_is_in_no_mean_and_in_no_file():
    row = dict.fromkeys(("marked", "train", "train_narrow", "test", "test_narrow", "precision", "no_edit"), 0.5)
    rows = [row | {"ciede2000": float("nan")}, row | {"ciede2000": 4.0}]
    assert mean_of(rows)["ciede2000"] == 4
    assert "ciede2000" not in without_nan({"a": rows[0]})["a"]


def test_a_crop_shows_most_of_a_thin_part(part):
    shown = np.zeros((300, 200), bool)
    shown[250:290, 150:190] = part.pixels
    crop = crop_of(shown, shown, [shown])
    assert crop.pictures[0].shape == (128, 128) and crop.pictures[0].sum() == crop.missed == 90


def test_the_truth_of_a_capture_tells_rays_and_rough_masks_or_that_there_are_none(tmp_path):
    write_json(tmp_path / "labels" / "names.json", {"mug": 1, "wheel": 2})
    write_json(tmp_path / "edits.json", {"edits": {}})
    write_png(tmp_path / "thin" / "mug" / "test" / "r_000.png", np.where(rays_of(ROD), 255, 0).astype(np.uint8))
    write_png(tmp_path / "coarse_masks" / "one" / "mug" / "r_003.png", np.where(ROD, 255, 0).astype(np.uint8))
    truth = Truth(tmp_path)
    assert (truth.thin_rays("mug", "test", 0) == rays_of(ROD)).all()
    assert truth.thin_rays("wheel", "test", 0) is None
    assert (truth.rough_mask("mug", "r_003") == ROD).all() and truth.rough_mask("mug", "r_004") is None


def test_a_part_that_is_marked_in_half_is_judged_in_that_half(part):
    half = ROWS < 15
    marked = ThinPart(part.wide & half, part.narrow & half, part.around)
    assert count(ROD & half, ROD, marked).wide_held == marked.pixels.sum() == 45
