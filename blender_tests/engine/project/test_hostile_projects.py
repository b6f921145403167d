"""Untrusted projects and captures: no name leaves the folder, and no value ends in a traceback."""

import json
import os
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import save_file

from blender_tests.engine.reference.capture_files import centered, put_json, random_rig, write_transforms
from karf_engine.capture import open_capture
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View, capture_from_json, capture_to_json
from karf_engine.cli import main
from karf_engine.errors import KarfError
from karf_engine.heads.files import SURFACE_SCHEMA, load_segmentation, load_surface
from karf_engine.io.checkpoints import load_tensors, save_tensors
from karf_engine.io.names import is_file_name
from karf_engine.palettes.palette import read_palettes
from karf_engine.project import Project
from karf_engine.recolor.model import Model
from karf_engine.segmentation.report import SegmentationReport

ESCAPES = ("../x", "", "a/b", "NUL.png", "x" * 300, 5)  # more of them: test_files.py
NAN, INF = float("nan"), float("inf")
POSE = np.eye(4)
FAR = [[1, 0, 0, 1e25], *POSE[1:].tolist()]


def rejection(read, *arguments):
    with pytest.raises(KarfError) as caught:
        read(*arguments)
    assert caught.value.hint and len(caught.value.sentence) < 1000
    return caught.value.sentence


def rewrite_json(path, change):
    """Change the content of a JSON file."""
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def rewrite_facts(path, change):
    """Change the facts in the header of a safetensors file."""
    with safe_open(path, "pt") as stored:
        own = json.loads(stored.metadata()["karf"])
        tensors = {key: stored.get_tensor(key) for key in stored.keys()}
    change(own["facts"])
    save_file(tensors, path, {"karf": json.dumps(own)})


@pytest.fixture(scope="module")
def received(learned, tmp_path_factory):
    """A learned project as early versions wrote it: without checksums, and outputs beside project.json."""
    project = shutil.copytree(learned.project, tmp_path_factory.mktemp("received") / "project")

    def without_checksums(state):
        del state["checksum"]
        for summary in state["stages"].values():
            shutil.copytree(project / "results" / summary.pop("folder"), project, dirs_exist_ok=True)
            del summary["files"]

    rewrite_json(project / "project.json", without_checksums)
    return project


@pytest.fixture
def project(received):
    """The received project, whose top-level files are restored after the test."""
    before = {path: path.read_bytes() for path in received.iterdir() if path.is_file()}
    yield received
    for path, content in before.items():
        path.write_bytes(content)


def facts(**values):
    return lambda known: known.update(values)


CHANGES = {
    "geometry.safetensors": [
        *(facts(kind=kind) for kind in ("cloud", ["voxels"], "nerf")),
        *(facts(voxel=size) for size in ("wide", 0.0, NAN)),
        *(facts(width=10**9), facts(n_features=10**9), facts(density_bias=None), facts(step=1e-320), facts(step="1")),
        *(facts(background_kind=3), facts(space={})),
        facts(space={"kind": "contraction", "center": [0, 0], "radius": 1, "room": 1, "near": 1}),
    ],
    "segmentation.safetensors": [
        facts(settings=5),
        *(facts(objects=names) for names in (["ball"], None, ["block", "ball"], ["../../escaped", "block"])),
    ],
    "recoloring.safetensors": [
        *(facts(settings={"width": 9}), facts(settings=None)),
        *(facts(sizes=sizes) for sizes in ([10**9], "many", [], [2, 2, 2])),
    ],
    "project.json": [
        lambda state: state["stages"]["geometry"].update(files=3.5),
        lambda state: state["stages"]["geometry"].update(settings=7),
        lambda state: state.update(schema="x" * 5000),
        lambda state: state["settings"].update({"x" * 5000: 1}),
        lambda state: state["settings"]["geometry"].update(table_rate=10**400),
    ],
    "palette.json": [lambda palettes: palettes["objects"][0].update(name="pot")],
}


@pytest.mark.parametrize(("file", "change"), [(file, change) for file, rows in CHANGES.items() for change in rows])
def test_hostile_values_of_learned_files_are_rejected(project, file, change):
    (rewrite_json if file.endswith(".json") else rewrite_facts)(project / file, change)
    sentence = rejection(Model, Project(project))
    assert file != "palette.json" or "palette.json holds palettes of pot" in sentence


@pytest.mark.parametrize(
    ("file", "read"),
    [("segmentation.safetensors", lambda path: load_segmentation(path, 6)), ("surface.safetensors", load_surface)],
)
def test_object_names_of_learned_files_cannot_leave_the_folder(project, file, read):
    rewrite_facts(project / file, lambda facts: facts["objects"].__setitem__(0, "../../escaped"))
    assert "cannot be the name of a file" in rejection(read, project / file)


@pytest.mark.parametrize("name", ["positions", "viewdirs", "colors", "object", "sure", "view"])
def test_incomplete_surface_rays_are_rejected(project, name):
    path = project / "surface.safetensors"
    tensors, facts = load_tensors(path, SURFACE_SCHEMA)
    for wrong in (tensors | {name: tensors[name][:-1]}, {key: t for key, t in tensors.items() if key != name}):
        save_tensors(path, wrong, SURFACE_SCHEMA, facts)
        assert "surface.safetensors is damaged" in rejection(load_surface, path)


@pytest.mark.parametrize("report", [[], {}, {"views": ["../x"]}])
def test_malformed_segmentation_reports_are_rejected(tmp_path, report):
    put_json(tmp_path / "segmentation.json", report)
    assert "segmentation.json" in rejection(SegmentationReport.read, tmp_path / "segmentation.json")


def test_hostile_view_names_write_nothing_outside(project, tmp_path, capsys):
    def escape(content):
        for view in content["views"]:
            view["name"] = view["stem"] = f"../../escaped_{view['name']}"

    rewrite_json(project / "capture.json", escape)
    assert main(["render", str(project), "--views", "test", "--planes", "--out", str(tmp_path / "out" / "here")]) == 4
    assert "cannot be the name of a file" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*escaped*")) and not list(project.parent.rglob("*escaped*"))


PALETTE = {"name": "pot", "colors": [[0, 0, 0], [1, 0, 0]], "initial": [[0, 0, 0], [1, 0, 0]]}
NO_INITIAL = [None, 5, [], [[0, 0, 0], [NAN] * 3], [[0, 0, 0]] * 10_000, "red"]


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        *(({"name": name}, "colors", "cannot be the name of a file") for name in ESCAPES),
        *(({"initial": value}, "initial", "palette.json: palette of 'pot'") for value in NO_INITIAL),
    ],
)
def test_malformed_palettes_are_rejected(tmp_path, changes, kind, words):
    path = tmp_path / "palette.json"
    put_json(path, {"schema": "karf-palette/1", "shared": False, "objects": [PALETTE | changes]})
    assert words in rejection(read_palettes, path, kind)
    assert "name" in changes or len(read_palettes(path)) == 1


def capture():
    view = View("a", "a", Camera(8, 6, 7.0, 7.0, 4.0, 3.0, POSE), None, "train", (1.0, 5.0))
    return capture_to_json(Capture(Path(os.curdir), "test", (view,)))


NO_CAPTURE = "not a canonical capture"
FRAME = {"file_path": "frame_1", "w": 64, "h": 36, "fl_x": 70.0, "transform_matrix": POSE.tolist()}


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        *((key, name, "cannot be the name of a file") for key in ("name", "stem") for name in ESCAPES),
        *(("size", [0, 6], "0x6 pixels"), ("size", [10**5, 10**4], "100000x10000 pixels"), ("size", "big", NO_CAPTURE)),
        *(("intrinsics", [value, 7, 4, 3], f"fx {value:g}") for value in (1e200, 1e-200, 1e12)),
        ("intrinsics", [7, NAN, 4, 3], "fy nan"),
        ("intrinsics", [7, 7, 1e200, 3], "cx 1e+200"),
        ("intrinsics", [7], NO_CAPTURE),
        *(("distortion", [1e200], "coefficient 1e+200"), ("distortion", None, NO_CAPTURE)),
        *(("camera_to_world", FAR, "the position 1e+25"), ("camera_to_world", {}, NO_CAPTURE)),
        ("camera_to_world", [[NAN] * 4] * 4, "the position nan"),
        *(("depth_bounds", [5.0, 1.0], "depth bounds 5 and 1"), ("depth_bounds", [1.0, INF], "depth bounds 1 and inf")),
        ("depth_bounds", ["near"], NO_CAPTURE),
        *(("split", "../x", NO_CAPTURE), ("split", ["train"], NO_CAPTURE), ("image", 7, NO_CAPTURE)),
    ],
)
def test_hostile_values_of_captures_are_rejected(tmp_path, key, value, words):
    content = capture()
    content["views"][0][key] = value
    sentence = rejection(capture_from_json, content, tmp_path / "capture.json")
    assert "capture.json" in sentence and words in sentence


TWICE = capture() | {"views": capture()["views"] * 2}


@pytest.mark.parametrize("content", [None, 5, [], "text", {"schema": "karf-capture/1"}, {"schema": []}, TWICE])
def test_malformed_captures_are_rejected(tmp_path, content):
    sentence = rejection(capture_from_json, content, tmp_path / "capture.json")
    assert "capture.json" in sentence and ("twice" in sentence) == (content is TWICE)


def test_strange_photo_names_become_safe_view_names(tmp_path):
    names = ["a:b.png", "a?b.png", "con.png", f"{'n' * 240}.png", "new\nline.png"]
    write_transforms(tmp_path, [centered(camera) for camera in random_rig(3, len(names))], names)
    found = open_capture(tmp_path)
    assert all(is_file_name(view.name) and is_file_name(view.stem) for view in found.views)
    assert len({view.name for view in found.views}) == len(names)
    assert [view.image.name for view in found.views] == names  # the photos keep theirs
    again = capture_from_json(capture_to_json(found), tmp_path / "capture.json")
    assert [view.name for view in again.views] == [view.name for view in found.views]


@pytest.mark.parametrize(
    ("fields", "words"),
    [({"fl_x": 1e200}, "fx 1e+200"), ({"w": 100_000, "h": 100_000}, "100000x100000 pixels, more than 400 million")],
)
def test_impossible_cameras_are_rejected_with_their_value(tmp_path, fields, words):
    put_json(tmp_path / "cameras.json", {"frames": [FRAME | fields]})
    sentence = rejection(open_capture, tmp_path / "cameras.json", False)
    assert "cameras.json, frame 0 ('frame_1')" in sentence and words in sentence


def test_shared_frame_fields_are_not_copied_per_frame(tmp_path):
    put_json(tmp_path / "cameras.json", {"frames": [FRAME] * 300, **{f"key{n}": n for n in range(2000)}})
    tracemalloc.start()
    try:
        open_capture(tmp_path / "cameras.json", False)
        assert tracemalloc.get_traced_memory()[1] < 9e6
    finally:
        tracemalloc.stop()
