"""A project received from somebody: no name leads out of its folder, and no value ends in a traceback."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("scipy")
pytest.importorskip("imageio")

from blender_tests.engine.conftest import run_engine
from blender_tests.engine.reference.capture_files import centered, put_json, random_rig, write_transforms
from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.capture import open_capture
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View, capture_from_json, capture_to_json
from karf_engine.capture.reader_utils import unique_names
from karf_engine.errors import DataError
from karf_engine.io.files import read_json
from karf_engine.io.names import LONGEST, file_name, is_file_name
from karf_engine.palettes.palette import read_palettes
from karf_engine.project import Project

ESCAPES = (
    "../x",
    "..",
    ".",
    "",
    "a/b",
    "a\\b",
    "/etc/x",
    "C:x",
    "a\0b",
    "a\nb",
    "con",
    "NUL.png",
    "x" * 300,
    ".. ",
    "a.",
)
POSE = np.eye(4)


def capture():
    view = View("a", "a", Camera(8, 6, 7.0, 7.0, 4.0, 3.0, POSE), None, "train", (1.0, 5.0))
    return capture_to_json(Capture(Path(os.curdir), "test", (view,)))


def refusal(read, *arguments):
    with pytest.raises(DataError) as caught:
        read(*arguments)
    assert caught.value.hint and len(caught.value.sentence) < 1000
    return caught.value.sentence


def strangers_copy(learned, tmp_path):
    """Return a copy of a learned project as early versions wrote it: without checksums, outputs beside project.json."""
    project = shutil.copytree(learned.project, tmp_path / "project")

    def without_checksums(state):
        del state["checksum"]
        for summary in state["stages"].values():
            shutil.copytree(project / "results" / summary.pop("folder"), project, dirs_exist_ok=True)
            del summary["files"]

    rewrite_state(project, without_checksums)
    return project


def rewrite_state(project, change):
    """The content of project.json, changed in place."""
    state = json.loads((project / "project.json").read_text())
    change(state)
    (project / "project.json").write_text(json.dumps(state))


# ---------------------------------------------------------------------------------------------------------------- names
@pytest.mark.parametrize("name", [*ESCAPES, None, 5, [], "\udcff"])
def test_names_that_lead_elsewhere_are_no_file_names_and_made_ones_always_are(name):
    assert not is_file_name(name)
    if isinstance(name, str):
        assert is_file_name(file_name(name)) and file_name(file_name(name)) == file_name(name)
        assert is_file_name(f"train_{file_name(name)}_1000000")


@pytest.mark.parametrize("name", ["r_0", "IMG 0001 (2)", "mein Fóto 🏺", "a.b.c", "console", ".hidden", "#1 + 2 = 3"])
def test_usual_names_stay_as_they_are(name):
    assert is_file_name(name) and file_name(name) == name


@pytest.mark.parametrize("name", ESCAPES)
@pytest.mark.parametrize("key", ["name", "stem"])
def test_view_names_of_a_capture_never_leave_the_folder(tmp_path, name, key):
    content = capture()
    content["views"][0][key] = name
    sentence = refusal(capture_from_json, content, tmp_path / "capture.json")
    assert "capture.json has a" in sentence and "cannot be the name of a file" in sentence


@pytest.mark.parametrize("name", ESCAPES)
def test_object_names_of_palettes_never_leave_the_folder(tmp_path, name):
    entry = {"name": name, "colors": [[0, 0, 0], [1, 0, 0]], "initial": [[0, 0, 0], [1, 0, 0]]}
    put_json(tmp_path / "palette.json", {"schema": "karf-palette/1", "shared": False, "objects": [entry]})
    assert "cannot be the name of a file" in refusal(read_palettes, tmp_path / "palette.json")


def rewrite_facts(path, change):
    """Facts, changed in place, in the header of a safetensors file."""
    from safetensors import safe_open
    from safetensors.torch import save_file

    with safe_open(path, "pt") as stored:
        header, tensors = stored.metadata(), {key: stored.get_tensor(key) for key in stored.keys()}
    own = json.loads(header["karf"])
    change(own["facts"])
    save_file(tensors, path, {"karf": json.dumps(own)})


def job_of(project):
    from karf_engine.commands.job import open_job
    from karf_engine.commands.options import RenderOptions

    return open_job(RenderOptions(project=project, threads=1), lambda *_, **__: None, lambda: False)


@pytest.mark.parametrize("file", ["segmentation.safetensors", "surface.safetensors"])
def test_object_names_of_learned_files_never_leave_the_folder(learned, tmp_path, file):
    from karf_engine.heads.files import load_segmentation, load_surface

    project = strangers_copy(learned, tmp_path)
    rewrite_facts(project / file, lambda facts: facts["objects"].__setitem__(0, "../../escaped"))
    reads = {
        "segmentation.safetensors": lambda job: load_segmentation(
            job.project.verified(job.project.segmentation_file), 6
        ),
        "surface.safetensors": lambda job: load_surface(job.project.verified(job.project.surface_file)),
    }
    assert "cannot be the name of a file" in refusal(reads[file], job_of(project))


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("geometry.safetensors", {"kind": "cloud"}),
        ("geometry.safetensors", {"kind": ["voxels"]}),
        ("geometry.safetensors", {"kind": "nerf"}),
        ("geometry.safetensors", {"voxel": "wide"}),
        ("geometry.safetensors", {"voxel": 0.0}),
        ("geometry.safetensors", {"voxel": float("nan")}),
        ("geometry.safetensors", {"width": 10**9}),
        ("geometry.safetensors", {"n_features": 10**9}),
        ("geometry.safetensors", {"density_bias": None}),
        ("geometry.safetensors", {"step": 1e-320}),
        ("geometry.safetensors", {"step": "1"}),
        ("geometry.safetensors", {"background_kind": 3}),
        ("geometry.safetensors", {"space": {}}),
        (
            "geometry.safetensors",
            {"space": {"kind": "contraction", "center": [0, 0], "radius": 1, "room": 1, "near": 1}},
        ),
        ("segmentation.safetensors", {"settings": 5}),
        ("segmentation.safetensors", {"objects": ["ball"]}),
        ("segmentation.safetensors", {"objects": None}),
        ("segmentation.safetensors", {"objects": ["block", "ball"]}),
        ("recoloring.safetensors", {"settings": {"width": 9}}),
        ("recoloring.safetensors", {"settings": None}),
        ("recoloring.safetensors", {"sizes": [10**9]}),
        ("recoloring.safetensors", {"sizes": "many"}),
        ("recoloring.safetensors", {"sizes": []}),
        ("recoloring.safetensors", {"sizes": [2, 2, 2]}),
        ("project.json", lambda state: state["stages"]["geometry"].update(files=3.5)),
        ("project.json", lambda state: state["stages"]["geometry"].update(settings=7)),
        ("project.json", lambda state: state.update(schema="x" * 5000)),
        ("project.json", lambda state: state["settings"].update({"x" * 5000: 1})),
        ("project.json", lambda state: state["settings"]["geometry"].update(table_rate=10**400)),
    ],
)
def test_values_that_nobody_wrote_are_refused_in_a_sentence(learned, tmp_path, file, change):
    from karf_engine.errors import KarfError
    from karf_engine.recolor.model import Model

    project = strangers_copy(learned, tmp_path)
    if file == "project.json":
        rewrite_state(project, change)
    else:
        rewrite_facts(project / file, lambda facts: facts.update(change))
    with pytest.raises(KarfError) as caught:
        Model(Project(project))
    assert caught.value.hint and len(caught.value.sentence) < 1000


def test_palettes_of_other_objects_are_refused_in_a_sentence(learned, tmp_path):
    from karf_engine.recolor.model import Model

    project = strangers_copy(learned, tmp_path)
    palettes = json.loads((project / "palette.json").read_text())
    palettes["objects"][0]["name"] = "pot"
    (project / "palette.json").write_text(json.dumps(palettes))
    assert "palette.json holds palettes of pot" in refusal(Model, Project(project))


@pytest.mark.parametrize("name", ["positions", "viewdirs", "colors", "object", "sure", "view"])
def test_rays_of_objects_that_nobody_wrote_are_refused_in_a_sentence(learned, tmp_path, name):
    from karf_engine.heads.files import SURFACE_SCHEMA, load_surface
    from karf_engine.io.checkpoints import load_tensors, save_tensors

    project = strangers_copy(learned, tmp_path)
    path = project / "surface.safetensors"
    tensors, facts = load_tensors(path, SURFACE_SCHEMA)
    for wrong in (tensors | {name: tensors[name][:-1]}, {key: t for key, t in tensors.items() if key != name}):
        save_tensors(path, wrong, SURFACE_SCHEMA, facts)
        assert "surface.safetensors is damaged" in refusal(load_surface, path)


def test_a_hostile_project_writes_nothing_beside_its_folders(learned, tmp_path):
    project = strangers_copy(learned, tmp_path)
    content = json.loads((project / "capture.json").read_text())
    for view in content["views"]:
        view["name"] = view["stem"] = f"../../escaped_{view['name']}"
    (project / "capture.json").write_text(json.dumps(content))
    done = run_engine("render", project, "--views", "test", "--planes", "--out", tmp_path / "out" / "here")
    assert done.returncode == 4 and "cannot be the name of a file" in done.stderr and "Traceback" not in done.stderr
    assert not list(tmp_path.glob("escaped*")) and not list(tmp_path.glob("*/escaped*"))


def test_strange_photo_names_become_views_whose_names_can_be_files(tmp_path):
    names = ["a:b.png", "a?b.png", "con.png", f"{'n' * 240}.png", "new\nline.png"]
    write_transforms(tmp_path, [centered(camera) for camera in random_rig(3, len(names))], names)
    found = open_capture(tmp_path)
    assert all(is_file_name(view.name) and is_file_name(view.stem) for view in found.views)
    assert len({view.name for view in found.views}) == len(names)
    assert [view.image.name for view in found.views] == names  # the photos keep theirs
    again = capture_from_json(capture_to_json(found), tmp_path / "capture.json")
    assert [view.name for view in again.views] == [view.name for view in found.views]


def test_many_photos_of_one_name_are_numbered_without_delay():
    names = unique_names([("train", "0001")] * 20_000)
    assert len(set(names)) == 20_000 and names[:3] == ["train_0001", "train_0001_2", "train_0001_3"]


# -------------------------------------------------------------------------------------------------------- values, types
@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("size", [0, 6], "0x6 pixels"),
        ("size", [10**5, 10**4], "100000x10000 pixels"),
        ("size", "big", "not a canonical capture"),
        ("intrinsics", [1e200, 7, 4, 3], "fx 1e+200"),
        ("intrinsics", [7, float("nan"), 4, 3], "fy nan"),
        ("intrinsics", [7, 7, 1e200, 3], "cx 1e+200"),
        ("intrinsics", [7], "not a canonical capture"),
        ("distortion", [1e200], "coefficient 1e+200"),
        ("distortion", None, "not a canonical capture"),
        ("camera_to_world", [[1, 0, 0, 1e25], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "the position 1e+25"),
        ("camera_to_world", [[float("nan")] * 4] * 4, "the position nan"),
        ("camera_to_world", {}, "not a canonical capture"),
        ("depth_bounds", [5.0, 1.0], "depth bounds 5 and 1"),
        ("depth_bounds", [1.0, float("inf")], "depth bounds 1 and inf"),
        ("depth_bounds", ["near"], "not a canonical capture"),
        ("split", "../x", "not a canonical capture"),
        ("split", ["train"], "not a canonical capture"),
        ("image", 7, "not a canonical capture"),
    ],
)
def test_values_of_a_capture_that_cannot_be_are_named(tmp_path, key, value, words):
    content = capture()
    content["views"][0][key] = value
    sentence = refusal(capture_from_json, content, tmp_path / "capture.json")
    assert "capture.json" in sentence and words in sentence


@pytest.mark.parametrize("content", [None, 5, [], "text", {"schema": "karf-capture/1"}, {"schema": []}])
def test_what_is_no_capture_is_refused(tmp_path, content):
    assert "capture.json" in refusal(capture_from_json, content, tmp_path / "capture.json")


def test_two_views_of_one_name_are_refused(tmp_path):
    content = capture()
    content["views"] *= 2
    assert "twice" in refusal(capture_from_json, content, tmp_path / "capture.json")


@pytest.mark.parametrize(
    "change",
    [
        {"settings": 5},
        {"settings": [1]},
        {"stages": {"geometry": 7}},
        {"stages": {"geometry": {"fingerprint": 3}}},
        {"stages": {"geometry": {}}},
        {"stages": {"geometry": None}},
        {"stages": []},
        {"capture": None},
        {"outdated": 5},
    ],
)
def test_values_of_project_json_of_another_type_are_named(tmp_path, change):
    state = {"schema": "karf-project/1", "capture": "/film/pots", "stages": {}, "settings": {}}
    put_json(tmp_path / "project.json", state | change)
    assert "project.json" in refusal(Project(tmp_path).state)


@pytest.mark.parametrize("report", [[], {"views": 5}, {"views": "ab"}, {"views": [5]}, {"views": ["../x"]}, {}])
def test_values_of_segmentation_json_of_another_type_are_named(learned, tmp_path, report):
    from karf_engine.segmentation.report import SegmentationReport

    project = strangers_copy(learned, tmp_path)
    put_json(project / "segmentation.json", report)
    assert "segmentation.json" in refusal(SegmentationReport.read, project / "segmentation.json")


@pytest.mark.parametrize("initial", [None, 5, [], [[0, 0, 0], [float("nan")] * 3], [[0, 0, 0]] * 10_000, "red"])
def test_extracted_palettes_are_checked_like_learned_ones(tmp_path, initial):
    entry = {"name": "pot", "colors": [[0, 0, 0], [1, 0, 0]], "initial": initial}
    put_json(tmp_path / "palette.json", {"schema": "karf-palette/1", "shared": False, "objects": [entry]})
    assert len(read_palettes(tmp_path / "palette.json")) == 1
    assert "palette.json: palette of 'pot'" in refusal(read_palettes, tmp_path / "palette.json", "initial")


@pytest.mark.parametrize("make", NO_FILES)
def test_what_lies_in_place_of_a_json_file_is_named_and_never_waited_for(tmp_path, make):
    make(tmp_path / "edit.json")
    assert "not a file" in refusal(read_json, tmp_path / "edit.json", "edit")


def test_json_without_end_is_refused_by_its_size(tmp_path):
    with (tmp_path / "edit.json").open("wb") as file:
        file.truncate(1 << 30)  # no disk is used
    assert "1,073,741,824 bytes; at most 33,554,432 are read" in refusal(read_json, tmp_path / "edit.json", "edit")


# -------------------------------------------------------------------------------------------------------------- cameras
@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"fl_x": 1e200}, "fx 1e+200"),
        ({"fl_x": 1e-200}, "fx 1e-200"),
        ({"fl_x": 1e12}, "fx 1e+12"),
        ({"cx": 1e200}, "cx 1e+200"),
        ({"k1": 1e200}, "coefficient 1e+200"),
        ({"w": 100_000, "h": 100_000}, "100000x100000 pixels, more than 400 million"),
        ({"transform_matrix": [[1, 0, 0, 1e25], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, "not finite"),
    ],
)
def test_cameras_that_cannot_be_are_named_with_their_value(tmp_path, fields, words):
    frame = {"file_path": "frame_1", "w": 64, "h": 36, "fl_x": 70.0, "transform_matrix": POSE.tolist()}
    put_json(tmp_path / "cameras.json", {"frames": [frame | fields]})
    sentence = refusal(open_capture, tmp_path / "cameras.json", False)
    assert "cameras.json, frame 0 ('frame_1')" in sentence and words in sentence


def test_fields_that_frames_share_are_not_copied_for_each(tmp_path):
    import tracemalloc

    frame = {"file_path": "f", "w": 4, "h": 4, "fl_x": 4, "transform_matrix": POSE.tolist()}
    put_json(tmp_path / "cameras.json", {"frames": [frame] * 1000, **{f"key{n}": n for n in range(2000)}})
    tracemalloc.start()
    try:
        open_capture(tmp_path / "cameras.json", False)
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()


def test_the_longest_name_still_has_room_for_endings():
    assert LONGEST + len("-01234567.safetensors.tmp") < 255
