"""The shapes of edges in edits and in edit.json."""

import json

import numpy as np
import pytest

from karf_engine.errors import BadRequest, DataError
from karf_engine.palettes.edge_shape import EdgeShape
from karf_engine.palettes.palette import Edit, Palette, check_edit, edit_from_json, edit_to_json, read_edit, write_edit

POT = Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0]], np.float32))
MUG = Palette("mug", np.array([[0, 0, 0], [0.2, 0.2, 0.9]], np.float32))
COLORS = {"pot": POT.colors, "mug": MUG.colors}


def table(edges):
    return {"objects": {"pot": {"colors": [None, "#0000ff"], "edges": edges}}}


def test_a_file_keeps_them(tmp_path):
    edges = {"pot": EdgeShape(-1.5, 4), "mug": EdgeShape(feather=0.25)}
    write_edit(tmp_path / "edit.json", Edit(COLORS, edges=edges))
    assert read_edit(tmp_path / "edit.json", [POT, MUG]).edges == edges


def test_edits_without_them_are_written_as_before(tmp_path):
    plain = edit_to_json(Edit(COLORS))
    assert plain == edit_to_json(Edit(COLORS, edges={"pot": EdgeShape()}))
    assert all(set(entry) == {"colors"} for entry in plain["objects"].values())
    assert edit_from_json(plain, "edit.json", [POT, MUG]).edges == {}


def test_what_is_not_written_is_neutral():
    assert edit_from_json(table({"feather": 3}), "edit.json", [POT]).edges == {"pot": EdgeShape(0, 3)}
    assert edit_from_json(table({}), "edit.json", [POT]).edges == {}


@pytest.mark.parametrize("wrong", [{"choke": 17}, {"feather": -1}, {"choke": "2"}, {"feather": True}, [1, 2], 3, None])
def test_what_cannot_be_is_refused_by_name(wrong, tmp_path):
    content = {"schema": "karf-edit/1", **table(wrong)}
    (tmp_path / "edit.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"edit\.json: edit of 'pot' has the (edges|choke|feather)") as caught:
        read_edit(tmp_path / "edit.json", [POT])
    assert caught.value.hint


def test_edges_of_another_object_are_refused():
    with pytest.raises(BadRequest, match="lid"):
        check_edit(Edit(COLORS, edges={"lid": EdgeShape(1)}), [POT, MUG])


def test_a_frame_with_other_edges_is_another_frame():
    frame_fingerprint = pytest.importorskip("karf_engine.export.finished_frames").frame_fingerprint
    plain = frame_fingerprint("view", Edit(COLORS))
    assert frame_fingerprint("view", Edit(COLORS, edges={"pot": EdgeShape()})) == plain
    marks = [
        frame_fingerprint("view", Edit(COLORS, edges={"pot": EdgeShape(*each)})) for each in ((1, 0), (2, 0), (0, 1))
    ]
    assert len({plain, *marks}) == 4
