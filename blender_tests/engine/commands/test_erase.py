"""Floaters are erased by boxes: what is inside disappears from pictures and exports, stays in the file and comes back."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation

pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.commands.conftest import run
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.splats import details
from karf_engine.splats.files import load_all_gaussians, load_gaussians, save_gaussians
from karf_engine.splats.formats.registry import read_splats
from karf_engine.splats.gaussians import subset
from karf_engine.splats.kernels.arrays import COLOR, LOG_SCALE, LOGIT

CAMERA = camera_at(0.3, 0.5, size=48)
TURNED = Rotation.from_euler("xyz", (40, -25, 70), degrees=True).as_matrix()
BLOB = 1.9 * CAMERA.position / np.linalg.norm(CAMERA.position)  # center of the floater, before the objects
ALL = np.diag((1e6, 1e6, 1e6, 1.0))


def box(center, half, turn=TURNED):
    """16 numbers of an oriented box."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * np.asarray(half), center
    return tuple(matrix.ravel().tolist())


def put(project, gaussians):
    """Make these the project's splats."""
    result = project.new_result("splats")
    save_gaussians(gaussians, result / project.splats_file.name)
    project.amend("splats", result)


@pytest.fixture
def floating(copy):
    """The project with a floater of 40 Gaussians before the objects, and its splats without it."""
    clean = load_gaussians(copy.splats_file)
    blob = np.repeat(clean.table[:1], 40, 0)
    blob[:, :3] = BLOB + np.random.default_rng(0).uniform(-0.08, 0.08, (40, 3))
    blob[:, LOG_SCALE : LOG_SCALE + 3], blob[:, LOGIT], blob[:, COLOR:] = np.log(0.05), 3.0, 0.0
    blob[:, COLOR + 1] = 1.5
    visibility = None if clean.visibility is None else np.concatenate([clean.visibility[:40], clean.visibility])
    put(copy, replace(clean, table=np.concatenate([blob, clean.table]), visibility=visibility))
    return copy, clean


def shown(project):
    return karf.load(project.folder, "cpu").render(CAMERA).base


def test_picture_without_the_floater_is_the_picture_before_it_came(copy, request):
    before = shown(copy)
    project, clean = request.getfixturevalue("floating")
    assert np.abs(shown(project) - before).max() > 0.3
    assert karf.erase_splats(project.folder, [box(BLOB, 0.2)]) == 40
    assert_array_equal(shown(project), before)
    assert_array_equal(load_gaussians(project.splats_file).table, clean.table)
    assert project.finished("splats")["erased"] == 40 and project.is_intact("splats")


def test_exports_leave_the_floater_out(floating, tmp_path):
    project, clean = floating
    karf.erase_splats(project.folder, [box(BLOB, 0.2)])
    karf.export_splat(project.folder, tmp_path / "scene.ply")
    assert_array_equal(read_splats(tmp_path / "scene.ply").table, clean.table)


def test_restore_brings_back_every_bit(floating):
    project, _ = floating
    before, stages = project.splats_file.read_bytes(), project.state()["stages"]
    karf.erase_splats(project.folder, [box(BLOB, 0.2)])
    everything, erased = load_all_gaussians(project.splats_file)
    assert len(everything) == len(load_gaussians(project.splats_file)) + 40 and erased[:40].all()
    assert run("erase", project.folder, "--restore") == 0
    assert project.splats_file.read_bytes() == before
    assert project.finished("splats")["files"] == stages["splats"]["files"]
    assert {name: project.finished(name) for name in stages if name != "splats"} == {
        name: facts for name, facts in stages.items() if name != "splats"
    }
    assert karf.erase_splats(project.folder, restore=True) == 0, "there is nothing to bring back"


LONG = (1.0, 0.2, 0.2)  # half sides
AXIS = TURNED[:, 0]


@pytest.mark.parametrize(
    ("boxes", "erased"),
    [
        ([box((0, 0, 0), LONG)], [0, 1]),
        ([box((0, 0, 0), LONG, np.eye(3))], [0, 2]),
        ([box((0, 0, 0), LONG, np.diag((-1, 1, 1)))], [0, 2]),
        ([box((0, 0, 0), 0.1), box((5, 5, 5), 0.1)], [0, 3]),
    ],
    ids=["turned", "straight", "mirrored", "two boxes"],
)
def test_gaussians_with_their_center_in_a_box_are_erased(copy, boxes, erased):
    some = subset(load_gaussians(copy.splats_file), np.arange(5))
    some.table[:, :3] = (0, 0, 0), 0.9 * AXIS, (0.9, 0, 0), (5, 5, 5), 1.1 * AXIS
    put(copy, some)
    assert run("erase", copy.folder, *(f"--box={','.join(map(str, each))}" for each in boxes)) == 0
    assert np.flatnonzero(load_all_gaussians(copy.splats_file)[1]).tolist() == erased


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"boxes": [box((0, 0, 99), 1)]}, "Box 1 of 1 holds no splats"),
        ({"boxes": [box((0, 0, 0), 1), box((0, 0, 99), 1)]}, "Box 2 of 2 holds no splats"),
        ({"boxes": [ALL.ravel().tolist()]}, "nothing would be left"),
        ({"boxes": [box((0, 0, 0), (1, 1, 0))]}, "makes no box"),
        ({"boxes": [box((0, 0, np.nan), 1)]}, "makes no box"),
        ({"boxes": [(*box((0, 0, 0), 1)[:12], 0, 0, 1, 1)]}, "makes no box"),
        ({}, "given no box"),
        ({"boxes": [box((0, 0, 0), 1)], "restore": True}, "given both"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_impossible_request_is_rejected_and_changes_nothing(copy, options, message):
    before = copy.state(), sorted(copy.path("results").iterdir())
    with pytest.raises(BadRequest, match=message) as caught:
        karf.erase_splats(copy.folder, **options)
    assert caught.value.hint and (copy.state(), sorted(copy.path("results").iterdir())) == before


def test_box_over_erased_splats_alone_holds_none(floating):
    project, _ = floating
    karf.erase_splats(project.folder, [box(BLOB, 0.2)])
    with pytest.raises(BadRequest, match="holds no splats"):
        karf.erase_splats(project.folder, [box(BLOB, 0.2)])


def test_project_without_splats_names_the_missing_stage(copy):
    copy.finish("geometry", "again")
    with pytest.raises(BadRequest, match="no finished splats stage"):
        karf.erase_splats(copy.folder, restore=True)
    with pytest.raises(DataError, match="is not a KaRF project"):
        karf.erase_splats(copy.folder / "nothing", restore=True)
    assert not (copy.folder / "nothing").exists()


def test_details_are_learned_without_the_floater_and_the_draft_keeps_it(floating, events, monkeypatch):
    project, clean = floating
    monkeypatch.setitem(details.QUALITIES, "good", details.Quality(64, 300, 40_000))
    asked = itertools.count()
    with pytest.raises(Cancelled):
        karf.learn_splats(project.folder, quality="good", threads=1, should_stop=lambda: next(asked) > 7)
    karf.erase_splats(project.folder, [box(BLOB, 0.2)])
    karf.learn_splats(project.folder, quality="good", threads=1, emit=events)
    assert not events.values("warning", "code"), "what was interrupted is of another draft"
    good, erased = load_all_gaussians(project.splats_file)
    assert len(good) == len(clean) + 300 and not erased.any() and "erased" not in project.finished("splats")
    karf.erase_splats(project.folder, [box((0, 0, 0), 0.3)])
    assert project.finished("splats")["quality"] == "good"
    karf.learn_splats(project.folder, threads=1)
    assert project.finished("splats")["erased"] == 40, "of the draft"
    karf.erase_splats(project.folder, restore=True)
    karf.learn_splats(project.folder, quality="good", threads=1)
    assert len(load_gaussians(project.splats_file)) == len(clean) + 340
