"""Votes of masks on points, their confidence, and the uncertainty of labels."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from karf_engine.errors import DataError
from karf_engine.segmentation.surface_points import Labels, ObjectDoubt, SurfaceUncertainty, merge_samples
from karf_engine.segmentation.views import mask_confidence, mask_targets, vote_on_points


def mask_of(row):
    return np.array([[c == "#" for c in row]])


def box(rows, columns):
    mask = np.zeros((200, 200), bool)
    mask[rows, columns] = True
    return mask


BODY = box(slice(50, 150), slice(50, 150))


def test_pixel_votes_for_its_objects_or_for_unmasked_classes():
    targets = mask_targets({1: mask_of("#.."), 3: mask_of(".#.")}, 4)
    # object 2 has no mask in this view: it may be what is seen outside
    assert_allclose(targets[0], [[0, 1, 0, 0], [0, 0, 0, 1], [0.5, 0, 0.5, 0]])
    assert_allclose(mask_targets({1: mask_of("##"), 2: mask_of(".#")}, 3)[0], [[0, 1, 0], [0, 0.5, 0.5]])


def test_confidence_grows_with_distance_from_the_border():
    confidence = mask_confidence({1: BODY})
    # the band is 6 pixels wide at 200 pixels of height
    assert_allclose(confidence[100, 44:56], np.r_[np.arange(6, 0, -1), np.arange(1, 7)] / 6)
    assert confidence[0, 0] == confidence[100, 100] == 1
    assert_allclose(mask_confidence({1: BODY, 2: np.zeros_like(BODY)}), confidence)
    for fill in (True, False):  # masks of everything or nothing have no border
        assert (mask_confidence({1: np.full((4, 6), fill)}) == 1).all()


def test_middles_of_small_and_thin_masks_keep_confidence():
    assert mask_confidence({1: box(slice(100, 105), slice(100, 105))})[102, 102] == 1
    handle = box(slice(99, 102), slice(150, 190))  # three pixels wide: it never leaves the band along the border
    confidence = mask_confidence({1: BODY | handle})
    assert confidence[100, 160:189].min() >= 0.8
    assert_allclose(confidence[70, 144:156], mask_confidence({1: BODY})[70, 144:156])


def test_votes_of_rays_are_averaged_on_their_points():
    point_of_sample = np.array([[0, 0], [0, 1], [1, 1]])
    targets = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    votes, confidence = vote_on_points(point_of_sample, targets, np.array([1.0, 0.5, 0.0]), 3)
    # point 0: one whole vote for class 0, half of a half vote for class 1
    assert_allclose(confidence, [1.25, 0.25, 0])
    assert_allclose(votes, [[0.8, 0.2], [0, 1], [0.5, 0.5]])


def test_merged_samples_agree_with_a_loop_over_cells():
    random = np.random.default_rng(0)
    positions, lab = random.uniform(-2, 3, (200, 3, 3)), random.uniform(0, 100, (200, 3))
    confidence = random.uniform(0.1, 1, 200)
    positions[-1], confidence[-1] = 9, 0  # an isolated sample without a vote
    points = merge_samples(positions, lab, confidence, spacing=0.6)
    point = points.point_of_sample.ravel()
    flat, color, weight = positions.reshape(-1, 3), np.repeat(lab, 3, 0), np.repeat(confidence, 3)
    cells = np.floor((flat - flat.min(0)) / (1.4 * 0.6)).astype(int)
    assert len(points) == len(np.unique(cells, axis=0)) < 600
    for number in range(len(points)):
        own = point == number
        assert len(np.unique(cells[own], axis=0)) == 1
        own_weight = weight[own] + 1e-12
        assert_allclose(points.positions[number], np.average(flat[own], 0, own_weight), atol=1e-9)
        assert_allclose(points.lab[number], np.average(color[own], 0, own_weight), atol=1e-9)


def test_doubt_measures_how_opinions_contradict_labels():
    probabilities, opinion = np.array([[0.1, 0.9], [0.9, 0.1]]), np.array([[0.4, 0.6], [0.75, 0.25]])
    assert_allclose(Labels(probabilities, np.ones(1), opinion).doubt, [[0.4], [0.25]])
    sentence = ObjectDoubt(0.12, 0.9).sentence("mug")
    assert sentence == "12% of 'mug' is unsure, most of it where no marked photo shows it."
    assert "masks and colors contradict each other" in ObjectDoubt(0.12, 0.1).sentence("mug")


def test_doubts_come_from_the_nearest_point_and_round_trip(tmp_path):
    positions, doubts = np.array([[0, 0, 0], [1, 0, 0]], np.float32), np.array([[255, 0], [0, 51]], np.uint8)
    SurfaceUncertainty(["mug", "pot"], positions, doubts).write(tmp_path / "doubts.npz")
    found = SurfaceUncertainty.read(tmp_path / "doubts.npz")
    assert found.objects == ["mug", "pot"]
    assert_allclose(found.at(np.array([[0.1, 0, 0], [2.0, 0, 0]])), [[1, 0], [0, 0.2]])


@pytest.mark.parametrize("doubts", [np.zeros((2, 2), np.uint8), np.zeros((3, 1), np.uint8), np.zeros((2, 1))])
def test_doubts_of_wrong_shape_or_type_are_rejected(tmp_path, doubts):
    path = tmp_path / "doubts.npz"
    SurfaceUncertainty(["mug"], np.zeros((2, 3), np.float32), doubts).write(path)
    with pytest.raises(DataError, match="doubts"):
        SurfaceUncertainty.read(path)
