"""Masks by color: what a rule's hue says, and what a watershed makes of pixels whose hue says nothing."""

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("skimage")

from tools.scenes.color_masks import ColorRule, large_parts, masks_by_color, without_small_holes
from tools.scenes.real_captures import CAPTURES

SIZE = 80
ROWS, COLUMNS = np.indices((SIZE, SIZE))
LEAVES, RED, YELLOW, BROWN, ORANGE = (
    (0.15, 0.35, 0.15),
    (0.8, 0.15, 0.1),
    (0.85, 0.75, 0.2),
    (0.55, 0.32, 0.12),
    (0.85, 0.5, 0.2),
)
RULES = {
    "apple": ColorRule((345, 20), saturation=0.5, value=0.25),
    "banana": ColorRule((40, 75), saturation=0.42, value=0.3),
}


def disk(row, column, radius):
    return np.hypot(ROWS - row, COLUMNS - column) < radius


def painted(*parts, ground=(0.75, 0.73, 0.7)):
    """A picture of masks in colors on a ground."""
    picture = np.broadcast_to(np.array(ground), (SIZE, SIZE, 3)).copy()
    for mask, color in parts:
        picture[mask] = color
    return picture


def iou(mask, other):
    return (mask & other).sum() / (mask | other).sum()


def test_things_are_told_apart_by_their_hue():
    apple, banana = disk(40, 25, 14), disk(40, 56, 14)
    masks = masks_by_color(painted((apple, RED), (banana, YELLOW)), RULES)
    assert iou(masks["apple"], apple) > 0.95 and iou(masks["banana"], banana) > 0.95


def test_both_parts_of_a_thing_that_another_one_hides_in_the_middle_are_its():
    apple = disk(40, 40, 14)
    banana = (np.abs(ROWS - 40) < 6) & ~apple
    masks = masks_by_color(painted((banana, YELLOW), (apple, RED)), RULES)
    assert iou(masks["banana"], banana) > 0.9 and not (masks["banana"] & disk(40, 40, 12)).any()


def test_a_spot_without_a_hue_of_its_own_belongs_to_what_surrounds_it():
    apple, spot, glint = disk(40, 40, 18), disk(40, 46, 4), disk(34, 34, 1.5)
    masks = masks_by_color(painted((apple, RED), (spot, BROWN), (glint, (1, 1, 1))), RULES)
    assert iou(masks["apple"], apple) > 0.95 and not masks["banana"].any()


def test_a_rim_of_an_unsure_hue_goes_to_the_side_with_the_weaker_edge():
    apple = disk(40, 40, 18)
    rim = apple & (ROWS < 30)
    masks = masks_by_color(painted((apple, RED), (rim, ORANGE)), RULES)
    assert iou(masks["apple"], apple) > 0.95


def test_what_is_gray_or_dark_or_of_another_hue_is_background():
    masks = masks_by_color(painted((disk(20, 20, 10), (0.1, 0.02, 0.02)), (disk(60, 60, 10), LEAVES)), RULES)
    assert not any(mask.any() for mask in masks.values())


def test_a_spill_onto_a_shadow_stops_at_the_edge():
    apple, shadow = disk(40, 40, 14), (ROWS > 50) & (ROWS < 58) & (np.abs(COLUMNS - 40) < 14)
    masks = masks_by_color(painted((shadow, (0.45, 0.36, 0.33)), (apple, RED)), RULES)
    assert iou(masks["apple"], apple) > 0.95


def test_hues_run_over_zero_and_slack_widens_them():
    hsv = np.array([[[350, 0.6, 0.6], [10, 0.6, 0.6], [180, 0.6, 0.6], [28, 0.6, 0.6], [10, 0.42, 0.6]]], np.float32)
    rule = RULES["apple"]
    assert rule.fits(hsv).tolist() == [[True, True, False, False, False]]
    assert rule.fits(hsv, hue_slack=10, slack=0.1).tolist() == [[True, True, False, True, True]]


def test_specks_are_no_parts():
    mask = disk(40, 40, 20)
    mask[2:4, 2:4] = True
    assert large_parts(mask)[40, 40] and not large_parts(mask)[:5].any()
    assert not large_parts(np.zeros((4, 4), bool)).any()


def test_small_holes_are_filled_and_large_ones_show_what_is_behind():
    thing = disk(40, 40, 30)
    filled = without_small_holes(thing & ~disk(30, 40, 1.5) & ~disk(50, 40, 6))
    assert filled[30, 40] and not filled[50, 40]
    assert not (filled & ~thing).any()


def test_a_blossom_stands_out_from_leaves():
    blossom = disk(40, 40, 15)
    masks = masks_by_color(
        painted((blossom, (0.9, 0.35, 0.25)), (disk(40, 40, 4), YELLOW), ground=LEAVES), CAPTURES["flower"].rules
    )
    assert iou(masks["blossom"], blossom) > 0.95
