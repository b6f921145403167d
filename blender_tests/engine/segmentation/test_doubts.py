"""How unsure labels are: where opinions differ, and what no mark shows."""

import numpy as np
import pytest

from karf_engine.errors import DataError
from karf_engine.segmentation.surface_points import Labels, ObjectDoubt, SurfaceUncertainty


def test_a_label_is_doubted_as_far_as_opinions_contradict_it():
    probabilities, opinion = np.array([[0.1, 0.9], [0.9, 0.1]]), np.array([[0.4, 0.6], [0.75, 0.25]])
    np.testing.assert_allclose(Labels(probabilities, np.ones(1), opinion).doubt, [[0.4], [0.25]])


def test_doubts_are_those_of_the_nearest_point_and_survive_their_file(tmp_path):
    positions = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    SurfaceUncertainty(["mug", "pot"], positions, np.array([[255, 0], [0, 51]], np.uint8)).write(
        tmp_path / "doubts.npz"
    )
    found = SurfaceUncertainty.read(tmp_path / "doubts.npz")
    assert found.objects == ["mug", "pot"]
    np.testing.assert_allclose(found.at(np.array([[0.1, 0, 0], [2.0, 0, 0]])), [[1, 0], [0, 0.2]])


@pytest.mark.parametrize("doubts", [np.zeros((2, 2), np.uint8), np.zeros((3, 1), np.uint8), np.zeros((2, 1))])
def test_a_file_of_other_shapes_or_types_is_refused(tmp_path, doubts):
    path = tmp_path / "doubts.npz"
    SurfaceUncertainty(["mug"], np.zeros((2, 3), np.float32), doubts).write(path)
    with pytest.raises(DataError, match="doubts"):
        SurfaceUncertainty.read(path)


def test_the_sentence_says_how_much_is_unsure_and_why():
    assert (
        ObjectDoubt(0.12, 0.9).sentence("mug") == "12% of 'mug' is unsure, most of it where no marked photo shows it."
    )
    assert "masks and colors contradict each other" in ObjectDoubt(0.12, 0.1).sentence("mug")
