"""Boxes and meshes that objects must be inside or outside of."""

import json

import numpy as np
import pytest
import torch

from karf_engine.errors import DataError
from karf_engine.fields.rendering.space import Similarity
from karf_engine.heads.fields import SegmentationField, Volumes
from karf_engine.heads.files import load_segmentation, save_segmentation
from karf_engine.project.settings import SegmentationSettings
from karf_engine.project.volumes import Volume, read_volumes, write_volumes

MOVED = np.array([[2.0, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])  # x from -1 to 3
CORNERS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
POINTS = torch.tensor([[2.5, 0.0, 0.0], [0.3, 0.3, 0.3], [9.0, 9.0, 9.0]])


def test_volumes_round_trip(tmp_path):
    path, mesh = tmp_path / "volumes.json", Volume("outside", None, CORNERS, np.array([[0, 1, 2]]))
    assert read_volumes(path) == {}
    write_volumes(path, {"pot": [Volume("inside", MOVED)], "lid": [mesh]})
    read = read_volumes(path)
    np.testing.assert_array_equal(read["pot"][0].matrix, MOVED)
    np.testing.assert_array_equal(read["lid"][0].vertices, CORNERS)
    assert [read[name][0].kind for name in ("pot", "lid")] == ["inside", "outside"]


def test_volumes_bound_their_object_and_no_other():
    volumes = {"pot": [Volume("inside", MOVED), Volume("outside", None, CORNERS)], "gone": [Volume("inside", MOVED)]}
    allowed = Volumes.from_objects(volumes, ["lid", "pot"])(POINTS, 2)
    assert allowed[:, 1].tolist() == [True, False, False]
    assert allowed[:, 0].all()
    assert Volumes.from_objects({}, ["lid", "pot"])(POINTS, 2).all()
    flat = Volume("inside", None, np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    with pytest.raises(DataError, match="'pot' is flat"):
        Volumes.from_objects({"pot": [flat]}, ["pot"])


@pytest.fixture
def bounded():
    """F_s of two objects in a grid half as large as the world; the second must be in a box."""
    torch.manual_seed(0)
    boxes = torch.tensor([[[-9.0] * 3, [9.0] * 3]] * 2)
    volumes = Volumes.from_objects({"pot": [Volume("inside", MOVED)]}, ["lid", "pot"])
    space = Similarity(torch.diag(torch.tensor([0.5, 0.5, 0.5, 1.0])))
    return SegmentationField(boxes, 4, SegmentationSettings(width=8), volumes, space).requires_grad_(False)


def test_probability_is_zero_outside_the_volumes(bounded):
    grid = (torch.rand(500, 3) * 8 - 4) * 0.5
    world = grid / 0.5
    within = ((world[:, 0] > -1) & (world[:, 0] < 3) & (world[:, 1:].abs() < 1).all(1)).tolist()
    probabilities = bounded(grid, torch.zeros(500, 4))
    assert any(within) and not all(within)
    assert (probabilities[:, 2] > 0).tolist() == within
    assert (probabilities[:, 1] > 0).all()
    torch.testing.assert_close(probabilities.sum(1), torch.ones(500))


def test_volumes_are_saved_with_f_s_and_unknown_objects_are_rejected(bounded, tmp_path):
    path, positions, features = tmp_path / "f_s.safetensors", torch.rand(50, 3) * 2 - 1, torch.zeros(50, 4)
    save_segmentation(path, bounded, ["lid", "pot"], SegmentationSettings(width=8))
    again, _ = load_segmentation(path, 4, space=bounded.space)
    assert torch.equal(again(positions, features), bounded(positions, features))
    bounded.volumes.rules[0, 0] = 7
    save_segmentation(path, bounded, ["lid", "pot"], SegmentationSettings(width=8))
    with pytest.raises(DataError, match=r"f_s\.safetensors"):
        load_segmentation(path, 4)


@pytest.mark.parametrize("entry", [{"kind": "near"}, {}, {"matrix": [[0] * 4] * 4}, {"matrix": 3}])
def test_malformed_volumes_are_rejected(tmp_path, entry):
    path = tmp_path / "volumes.json"
    path.write_text(json.dumps({"schema": "karf-volumes/1", "objects": {"pot": [{"kind": "inside"} | entry]}}))
    with pytest.raises(DataError, match=r"volumes\.json"):
        read_volumes(path)
