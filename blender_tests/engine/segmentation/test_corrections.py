"""Corrections: what is read of them, and that they are obeyed, near what they were drawn on and nowhere else."""

import imageio.v3 as iio
import numpy as np
import pytest

from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View
from karf_engine.errors import DataError
from karf_engine.segmentation.corrections import (
    NOT_OBJECT,
    OBJECT,
    Constraints,
    correction_targets,
    find_corrections,
    load_correction,
    spread,
)
from karf_engine.segmentation.label_propagation import neighbor_graph
from karf_engine.segmentation.surface_points import Labels

CAMERA = Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))


@pytest.fixture
def read(tmp_path):
    """Read the corrections of the pot that are drawn on a view: places that are it, and places that are not."""

    def read(name, is_it=(), is_not=()):
        picture = np.zeros((12, 18, 2), np.uint8)
        for value, pixels in ((255, is_it), (0, is_not)):
            for place in pixels:
                picture[place] = value, 255
        (tmp_path / "pot").mkdir()
        iio.imwrite(tmp_path / "pot" / f"{name}.png", picture)
        return find_corrections(tmp_path, capture(tmp_path))

    return read


def capture(folder):
    views = [View(name, name, CAMERA, None, split) for name, split in (("a", "train"), ("held", "test"))]
    return Capture(folder, "test", tuple(views))


@pytest.mark.parametrize("folder", ["no folder", "."])
def test_there_may_be_none_and_folders_may_be_empty(tmp_path, folder):
    (tmp_path / "pot").mkdir()
    assert find_corrections(tmp_path / folder, capture(tmp_path)) == []


@pytest.mark.parametrize("name", ["a", "held"])
def test_white_is_the_object_black_is_not_and_nothing_is_said_of_the_rest(read, name):
    (found,) = read(name, is_it=[np.s_[2:4, 3:9]], is_not=[np.s_[8:10, :]])
    assert (found.object_name, found.view.name) == ("pot", name)
    expected = np.zeros((12, 18), int)
    expected[2:4, 3:9], expected[8:10] = OBJECT, NOT_OBJECT
    np.testing.assert_array_equal(load_correction(found, CAMERA), expected)


def test_a_stroke_thinner_than_a_reduced_pixel_is_not_lost_and_a_picture_of_all_pixels_is_refused(read):
    (found,) = read("a", is_it=[np.s_[4:5, :]])
    assert (load_correction(found, CAMERA.scaled(6, 4))[1] == OBJECT).all()
    iio.imwrite(found.path, np.zeros((12, 18), np.uint8))
    with pytest.raises(DataError, match="has no alpha"):
        load_correction(found, CAMERA)


def test_a_pixel_is_what_one_correction_says_or_none_of_what_others_exclude():
    said = {1: np.array([[OBJECT, NOT_OBJECT, NOT_OBJECT, 0]]), 2: np.array([[0, 0, NOT_OBJECT, 0]])}
    targets, is_said = correction_targets(said, 3)
    assert is_said.tolist() == [[True, True, True, False]]
    assert targets[0, 0].tolist() == [0, 1, 0]
    assert targets[0, 1].tolist() == [0.5, 0, 0.5]
    assert targets[0, 2].tolist() == [1, 0, 0]


# a wall of 60 x 20 points, red on the left, green on the right; the labels say object up to column 40 of 30
PLACES = np.stack(np.meshgrid(np.arange(60.0), np.arange(20.0), indexing="ij"), -1).reshape(-1, 2)
COLUMN = PLACES[:, 0]
IS_RED = COLUMN < 30
LABELLED = np.where((COLUMN < 40)[:, None], [0.1, 0.9], [0.9, 0.1])


def spot(radius):
    """A stroke on the red."""
    return np.linalg.norm(PLACES - [15, 10], axis=1) < radius


def corrected(stroke, *target, labelled=LABELLED):
    """The labels before and after a stroke says these probabilities."""
    positions = np.column_stack([PLACES, np.zeros(len(PLACES))])
    lab = np.where(IS_RED[:, None], [50.0, 60.0, 40.0], [60.0, -40.0, 40.0])
    graph = neighbor_graph(positions, lab, np.tile([0.0, 0.0, 1.0], (len(lab), 1)), 1.0)
    targets = np.where(stroke[:, None], np.array(target, float), 1 / len(target))
    before = Labels(labelled, np.ones(len(target) - 1), labelled)
    return before, spread(before, graph, Constraints(targets, stroke))


def test_a_stroke_takes_with_it_what_is_near_and_alike():
    _, after = corrected((abs(COLUMN - 35) <= 1) & (abs(PLACES[:, 1] - 10) <= 7), 1, 0)
    assert (after.classes[~IS_RED & (COLUMN < 40)] == 0).mean() > 0.9
    assert (after.classes[IS_RED] == 1).mean() > 0.98
    np.testing.assert_allclose(after.probabilities.sum(1), 1)


def test_a_slip_of_the_hand_changes_little_but_is_obeyed():
    before, after = corrected(spot(1.2), 1, 0)
    assert (after.classes[spot(1.2)] == 0).all()
    assert (after.classes != before.classes).sum() <= 5 * spot(1.2).sum()


def test_a_stroke_that_agrees_changes_no_other_point():
    before, after = corrected(spot(5), 0, 1)
    assert (after.classes == before.classes).all()
    np.testing.assert_allclose(after.probabilities[~spot(5)], before.probabilities[~spot(5)], atol=1e-8)


def test_not_this_object_leaves_it_to_the_labels_which_other_it_is():
    _, after = corrected(spot(3), 0.5, 0, 0.5, labelled=np.tile([0.1, 0.6, 0.3], (len(PLACES), 1)))
    assert (after.classes[spot(3)] == 2).all()
