"""Tints of objects."""

from itertools import combinations


def test_tints_of_eight_objects_can_be_told_apart(addon):
    lab = addon.engine_api.srgb_to_lab([addon.tints.tint_of(index) for index in range(8)])
    assert min(addon.engine_api.ciede2000(first, second) for first, second in combinations(lab, 2)) > 15
    assert addon.tints.tint_of(8) == addon.tints.tint_of(0)
