"""What masks say: votes, confidence and their sums on points, by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("scipy")

from karf_engine.segmentation.surface_points import merge_samples
from karf_engine.segmentation.views import mask_confidence, mask_targets, vote_on_points


def mask_of(*rows):
    return np.array([[c == "#" for c in row] for row in rows])


def test_a_pixel_votes_for_its_object_and_outside_for_everything_without_a_mask():
    targets = mask_targets({1: mask_of("#.."), 3: mask_of(".#.")}, 4)
    assert_allclose(targets[0, 0], [0, 1, 0, 0])
    assert_allclose(targets[0, 1], [0, 0, 0, 1])
    # object 2 has no mask in this view: it may be what is seen outside
    assert_allclose(targets[0, 2], [0.5, 0, 0.5, 0])


def test_overlapping_masks_share_the_pixel():
    targets = mask_targets({1: mask_of("##"), 2: mask_of(".#")}, 3)
    assert_allclose(targets[0], [[0, 1, 0], [0, 0.5, 0.5]])


def test_confidence_grows_from_the_border_and_is_whole_far_from_it():
    mask = np.zeros((200, 200), bool)
    mask[50:150, 50:150] = True
    confidence = mask_confidence({1: mask})
    # the band is 6 pixels wide at 200 pixels of height
    assert_allclose(
        confidence[100, 44:56], [1, 5 / 6, 4 / 6, 3 / 6, 2 / 6, 1 / 6, 1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1]
    )
    assert confidence[0, 0] == confidence[100, 100] == 1
    assert_allclose(mask_confidence({1: mask, 2: np.zeros_like(mask)}), confidence)


def test_small_masks_have_a_narrow_band_so_that_their_middle_still_counts():
    mask = np.zeros((200, 200), bool)
    mask[100:105, 100:105] = True
    assert mask_confidence({1: mask})[102, 102] == 1


def test_the_middle_of_a_thin_handle_counts_as_much_as_the_body():
    mask = np.zeros((200, 200), bool)
    mask[50:150, 50:150] = True
    mask[99:102, 150:190] = True  # three pixels wide: it never leaves the band along the border
    confidence = mask_confidence({1: mask})
    assert confidence[100, 160:189].min() >= 0.8
    assert_allclose(
        confidence[70, 144:156], np.r_[np.arange(6, 0, -1), np.arange(1, 7)] / 6
    )  # the body's border is as it was


def test_masks_of_everything_or_nothing_have_no_border():
    for fill in (True, False):
        assert (mask_confidence({1: np.full((4, 6), fill)}) == 1).all()


def test_votes_of_rays_are_summed_on_the_points_of_their_samples():
    point_of_sample = np.array([[0, 0], [0, 1], [1, 1]])
    targets = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    votes, confidence = vote_on_points(point_of_sample, targets, np.array([1.0, 0.5, 0.0]), 3)
    # point 0: one whole vote for class 0, half of a half vote for class 1
    assert_allclose(confidence, [1.25, 0.25, 0])
    assert_allclose(votes, [[0.8, 0.2], [0, 1], [0.5, 0.5]])


def test_samples_merge_into_points_by_their_confidence():
    positions = np.array([[[0.0, 0.0, 0.0]], [[0.2, 0.0, 0.0]], [[9.0, 9.0, 9.0]]])
    lab = np.array([[10.0, 0, 0], [40.0, 0, 0], [70.0, 1, 2]])
    points = merge_samples(positions, lab, np.array([1.0, 0.5, 0.0]), spacing=1.0)
    assert points.point_of_sample.tolist() == [[0], [0], [1]]
    assert_allclose(points.positions, [[0.2 / 3, 0, 0], [9, 9, 9]])
    assert_allclose(points.lab, [[20, 0, 0], [70, 1, 2]])


def test_merging_agrees_with_a_loop_over_cells():
    random = np.random.default_rng(0)
    positions, lab = random.uniform(-2, 3, (200, 3, 3)), random.uniform(0, 100, (200, 3))
    confidence = random.uniform(0.1, 1, 200)
    points = merge_samples(positions, lab, confidence, spacing=0.6)
    point = points.point_of_sample.ravel()
    flat, color, weight = positions.reshape(-1, 3), np.repeat(lab, 3, 0), np.repeat(confidence, 3)
    cells = np.floor((flat - flat.min(0)) / (1.4 * 0.6)).astype(int)
    assert len(points) == len(np.unique(cells, axis=0)) < 600
    for number in range(len(points)):
        own = point == number
        assert len(np.unique(cells[own], axis=0)) == 1
        assert_allclose(points.positions[number], np.average(flat[own], 0, weight[own]))
        assert_allclose(points.lab[number], np.average(color[own], 0, weight[own]))
