"""Corrections are read from strokes, obeyed, and spread to near and similar points only."""

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
# a wall of 60 x 20 points, red left of column 30 and green right of it, labelled as object up to column 40
PLACES = np.stack(np.meshgrid(np.arange(60.0), np.arange(20.0), indexing="ij"), -1).reshape(-1, 2)
COLUMN = PLACES[:, 0]
IS_RED = COLUMN < 30
LABELLED = np.where((COLUMN < 40)[:, None], [0.1, 0.9], [0.9, 0.1])


@pytest.fixture
def read_strokes(tmp_path):
    """Draw strokes on and beside the pot in a view, and read them as corrections."""

    def read_strokes(name, is_it, is_not=None):
        picture = np.zeros((12, 18, 2), np.uint8)
        picture[is_it] = 255
        if is_not is not None:
            picture[is_not] = 0, 255
        (tmp_path / "pot").mkdir()
        iio.imwrite(tmp_path / "pot" / f"{name}.png", picture)
        return find_corrections(tmp_path, capture(tmp_path))

    return read_strokes


def capture(folder):
    views = [View(name, name, CAMERA, None, split) for name, split in (("a", "train"), ("held", "test"))]
    return Capture(folder, "test", tuple(views))


@pytest.mark.parametrize("folder", ["no folder", "."])
def test_missing_and_empty_folders_have_no_corrections(tmp_path, folder):
    (tmp_path / "pot").mkdir()
    assert find_corrections(tmp_path / folder, capture(tmp_path)) == []


@pytest.mark.parametrize("name", ["a", "held"])
def test_white_marks_the_object_and_black_excludes_it(read_strokes, name):
    (found,) = read_strokes(name, is_it=np.s_[2:4, 3:9], is_not=np.s_[8:10])
    assert (found.object_name, found.view.name) == ("pot", name)
    expected = np.zeros((12, 18), int)
    expected[2:4, 3:9], expected[8:10] = OBJECT, NOT_OBJECT
    np.testing.assert_array_equal(load_correction(found, CAMERA), expected)


def test_thin_strokes_survive_reduction_and_alpha_is_required(read_strokes):
    (found,) = read_strokes("a", is_it=np.s_[4:5])
    assert (load_correction(found, CAMERA.scaled(6, 4))[1] == OBJECT).all()
    iio.imwrite(found.path, np.zeros((12, 18), np.uint8))
    with pytest.raises(DataError, match="has no alpha"):
        load_correction(found, CAMERA)


def test_targets_combine_marked_and_excluded_objects():
    said = {1: np.array([[OBJECT, NOT_OBJECT, NOT_OBJECT, 0]]), 2: np.array([[0, 0, NOT_OBJECT, 0]])}
    targets, is_said = correction_targets(said, 3)
    assert is_said.tolist() == [[True, True, True, False]]
    assert targets[0, 0].tolist() == [0, 1, 0]
    assert targets[0, 1].tolist() == [0.5, 0, 0.5]
    assert targets[0, 2].tolist() == [1, 0, 0]


def disk(radius):
    """A round stroke on the red."""
    return np.linalg.norm(PLACES - [15, 10], axis=1) < radius


def correct(stroke, *target, labelled=LABELLED):
    """The labels before and after a stroke asks for these probabilities."""
    positions = np.column_stack([PLACES, np.zeros(len(PLACES))])
    lab = np.where(IS_RED[:, None], [50.0, 60.0, 40.0], [60.0, -40.0, 40.0])
    graph = neighbor_graph(positions, lab, np.tile([0.0, 0.0, 1.0], (len(lab), 1)), 1.0)
    targets = np.where(stroke[:, None], np.array(target, float), 1 / len(target))
    before = Labels(labelled, np.ones(len(target) - 1), labelled)
    return before, spread(before, graph, Constraints(targets, stroke))


def test_stroke_spreads_to_near_and_similar_points():
    _, after = correct((abs(COLUMN - 35) <= 1) & (abs(PLACES[:, 1] - 10) <= 7), 1, 0)
    assert (after.classes[~IS_RED & (COLUMN < 40)] == 0).mean() > 0.9
    assert (after.classes[IS_RED] == 1).mean() > 0.98
    np.testing.assert_allclose(after.probabilities.sum(1), 1)


def test_small_stroke_is_obeyed_and_spreads_little():
    before, after = correct(disk(1.2), 1, 0)
    assert (after.classes[disk(1.2)] == 0).all()
    assert (after.classes != before.classes).sum() <= 5 * disk(1.2).sum()


def test_agreeing_stroke_changes_no_other_point():
    before, after = correct(disk(5), 0, 1)
    assert (after.classes == before.classes).all()
    np.testing.assert_allclose(after.probabilities[~disk(5)], before.probabilities[~disk(5)], atol=1e-8)


def test_exclusion_falls_back_to_the_next_best_label():
    _, after = correct(disk(3), 0.5, 0, 0.5, labelled=np.tile([0.1, 0.6, 0.3], (len(PLACES), 1)))
    assert (after.classes[disk(3)] == 2).all()
