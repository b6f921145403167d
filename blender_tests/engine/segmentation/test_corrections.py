"""Corrections: what is read of them, and that they are obeyed, near what they were drawn on and nowhere else."""

import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

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
from karf_engine.segmentation.surface_points import Labels, SurfacePoints

CAMERA = Camera(18, 12, 20.0, 20.0, 9.0, 6.0, np.eye(4))


@pytest.fixture
def capture(tmp_path):
    return Capture(tmp_path, "test", tuple(View(name, name, CAMERA, None, split) for name, split in SPLITS))


SPLITS = (("a", "train"), ("held", "test"))


def draw(path, is_it=(), is_not=(), shape=(12, 18)):
    picture = np.zeros((*shape, 2), np.uint8)
    for value, pixels in ((255, is_it), (0, is_not)):
        for place in pixels:
            picture[place] = value, 255
    path.parent.mkdir(parents=True, exist_ok=True)
    iio.imwrite(path, picture)


def test_there_may_be_none_and_folders_may_be_empty(tmp_path, capture):
    assert find_corrections(tmp_path / "corrections", capture) == []
    (tmp_path / "corrections" / "pot").mkdir(parents=True)
    assert find_corrections(tmp_path / "corrections", capture) == []


def test_they_may_lie_on_any_view(tmp_path, capture):
    draw(tmp_path / "pot" / "held.png", is_it=[np.s_[2:4, 3:9]])
    (found,) = find_corrections(tmp_path, capture)
    assert (found.object_name, found.view.name) == ("pot", "held")


def test_white_is_the_object_black_is_not_and_nothing_is_said_of_the_rest(tmp_path, capture):
    draw(tmp_path / "pot" / "a.png", is_it=[np.s_[2:4, 3:9]], is_not=[np.s_[8:10, :]])
    (found,) = find_corrections(tmp_path, capture)
    expected = np.zeros((12, 18), int)
    expected[2:4, 3:9], expected[8:10] = OBJECT, NOT_OBJECT
    np.testing.assert_array_equal(load_correction(found, CAMERA), expected)


def test_a_stroke_thinner_than_a_reduced_pixel_is_not_lost(tmp_path, capture):
    draw(tmp_path / "pot" / "a.png", is_it=[np.s_[4:5, :]])
    (found,) = find_corrections(tmp_path, capture)
    assert (load_correction(found, CAMERA.scaled(6, 4))[1] == OBJECT).all()


def test_a_picture_that_says_something_of_every_pixel_is_refused(tmp_path, capture):
    (tmp_path / "pot").mkdir()
    iio.imwrite(tmp_path / "pot" / "a.png", np.zeros((12, 18), np.uint8))
    with pytest.raises(DataError, match="has no alpha"):
        load_correction(find_corrections(tmp_path, capture)[0], CAMERA)


def test_a_pixel_is_what_one_correction_says_or_none_of_what_others_exclude():
    said = {1: np.array([[OBJECT, NOT_OBJECT, NOT_OBJECT, 0]]), 2: np.array([[0, 0, NOT_OBJECT, 0]])}
    targets, is_said = correction_targets(said, 3)
    assert is_said.tolist() == [[True, True, True, False]]
    assert targets[0, 0].tolist() == [0, 1, 0]
    assert targets[0, 1].tolist() == [0.5, 0, 0.5]
    assert targets[0, 2].tolist() == [1, 0, 0]


# --------------------------------------------------------------------------------------------------------------- spreading
@pytest.fixture
def wall():
    """A wall of 60 x 20 points, red on the left, green on the right; the labels say object up to column 40 of 30."""
    grid = np.stack(np.meshgrid(np.arange(60.0), np.arange(20.0), indexing="ij"), -1).reshape(-1, 2)
    positions = np.column_stack([grid, np.zeros(len(grid))])
    red = positions[:, 0] < 30
    lab = np.where(red[:, None], [50.0, 60.0, 40.0], [60.0, -40.0, 40.0])
    points = SurfacePoints(positions, lab, np.zeros((0, 3), int), 1.0)
    graph = neighbor_graph(positions, lab, np.tile([0.0, 0.0, 1.0], (len(grid), 1)), 1.0)
    found = np.where((positions[:, 0] < 40)[:, None], [0.1, 0.9], [0.9, 0.1])
    return points, graph, Labels(found, np.ones(1), found), red


def constraints(points, fixed, *target):
    targets = np.where(fixed[:, None], np.array(target, float), 1 / len(target))
    return Constraints(targets, fixed)


def test_a_stroke_takes_with_it_what_is_near_and_alike(wall):
    points, graph, labels, red = wall
    x, y = points.positions[:, 0], points.positions[:, 1]
    stroke = (abs(x - 35) <= 1) & (abs(y - 10) <= 7)
    corrected = spread(labels, graph, constraints(points, stroke, 1, 0))
    assert (corrected.classes[(x >= 30) & (x < 40)] == 0).mean() > 0.9
    assert (corrected.classes[red] == 1).mean() > 0.98
    np.testing.assert_allclose(corrected.probabilities.sum(1), 1)


def test_a_slip_of_the_hand_changes_little_but_is_obeyed(wall):
    points, graph, labels, _ = wall
    stroke = np.linalg.norm(points.positions[:, :2] - [15, 10], axis=1) < 1.2
    corrected = spread(labels, graph, constraints(points, stroke, 1, 0))
    assert (corrected.classes[stroke] == 0).all()
    assert (corrected.classes != labels.classes).sum() <= 5 * stroke.sum()


def test_a_stroke_that_agrees_changes_no_other_point(wall):
    points, graph, labels, _ = wall
    stroke = np.linalg.norm(points.positions[:, :2] - [15, 10], axis=1) < 5
    corrected = spread(labels, graph, constraints(points, stroke, 0, 1))
    assert (corrected.classes == labels.classes).all()
    np.testing.assert_allclose(corrected.probabilities[~stroke], labels.probabilities[~stroke], atol=1e-8)


def test_not_this_object_leaves_it_to_the_labels_which_other_it_is(wall):
    points, graph, _, _ = wall
    found = np.tile([0.1, 0.6, 0.3], (len(points), 1))
    stroke = np.linalg.norm(points.positions[:, :2] - [15, 10], axis=1) < 3
    corrected = spread(Labels(found, np.ones(2), found), graph, constraints(points, stroke, 0.5, 0, 0.5))
    assert (corrected.classes[stroke] == 2).all()
