"""Boxes and meshes that objects must be inside or outside of."""

import json

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

from karf_engine.errors import DataError
from karf_engine.project.volumes import Volume, read_volumes, write_volumes
from karf_engine.segmentation.volumes import allowed_classes

MOVED = np.array([[2.0, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])  # x from -1 to 3
CORNERS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
POINTS = np.array([[2.5, 0.0, 0.0], [0.3, 0.3, 0.3], [9.0, 9.0, 9.0]])


def test_volumes_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "volumes.json"
    assert read_volumes(path) == {}
    write_volumes(
        path, {"pot": [Volume("inside", MOVED)], "lid": [Volume("outside", None, CORNERS, np.array([[0, 1, 2]]))]}
    )
    read = read_volumes(path)
    np.testing.assert_array_equal(read["pot"][0].matrix, MOVED)
    np.testing.assert_array_equal(read["lid"][0].vertices, CORNERS)
    assert [read[name][0].kind for name in ("pot", "lid")] == ["inside", "outside"]


def test_an_object_is_inside_its_boxes_and_outside_of_its_meshes_and_others_are_left_alone():
    volumes = {"pot": [Volume("inside", MOVED), Volume("outside", None, CORNERS)], "gone": [Volume("inside", MOVED)]}
    allowed = allowed_classes(volumes, ["lid", "pot"], POINTS)
    assert allowed[:, 2].tolist() == [True, False, False]
    assert allowed[:, :2].all()


def test_a_flat_mesh_is_refused_by_the_objects_name():
    flat = Volume("inside", None, np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    with pytest.raises(DataError, match="'pot' is flat"):
        allowed_classes({"pot": [flat]}, ["pot"], POINTS)


@pytest.mark.parametrize(
    "entry",
    [
        {"kind": "near"},
        {"kind": "inside"},
        {"kind": "inside", "matrix": [[0] * 4] * 4},
        {"kind": "inside", "matrix": 3},
    ],
)
def test_what_is_no_volume_is_named_with_its_file(tmp_path, entry):
    path = tmp_path / "volumes.json"
    path.write_text(json.dumps({"schema": "karf-volumes/1", "objects": {"pot": [entry]}}))
    with pytest.raises(DataError, match=r"volumes\.json"):
        read_volumes(path)
