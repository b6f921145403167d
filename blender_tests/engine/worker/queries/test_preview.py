"""The preview of any camera, asked of the engine as Blender asks it."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from blender_tests.engine.conftest import ROOT, finish_again, of_field
from karf_engine.capture.transforms import camera_to_json
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.palettes.compositing import read_planes
from karf_engine.project import Project
from karf_engine.recolor.model import Model
from karf_engine.worker.protocol import EventReader, Query, Request
from karf_engine.worker.queries.renders import preview
from karf_engine.worker.queries.session import Session


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project)


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


def asked(learned, model, **more):
    camera = model.capture.views[0].camera.scaled(450, 300)
    return {"project": str(learned.project), "camera": camera_to_json(camera), "long_side": 300} | more


def test_a_preview_is_the_planes_that_a_frame_of_the_camera_has(session, learned, model):
    answer = preview(session, asked(learned, model))
    planes, frame = read_planes(Path(answer["planes"])), model.render(model.capture.views[0].camera.scaled(300, 200))
    assert answer["size"] == [300, 200] and planes.base.shape == (200, 300, 3)
    assert planes.objects == tuple(model.objects)
    assert np.abs(planes.palette_weights - frame.palette_weights).max() < 2e-3
    assert np.abs(planes.base / 255 - frame.color).max() < 0.6 / 255


def test_a_coarse_preview_looks_the_same(session, learned, model):
    answer = preview(session, asked(learned, model, long_side=96))
    planes, frame = read_planes(Path(answer["planes"])), model.render(model.capture.views[0].camera.scaled(96, 64))
    assert np.abs(planes.base / 255 - frame.color).mean() < 1 / 255
    assert np.abs(planes.palette_weights - frame.palette_weights).mean() < 0.02


def test_the_model_is_loaded_once(session, learned, model):
    for _ in range(2):
        preview(session, asked(learned, model, long_side=16))
    assert session.model(str(learned.project)) is session.model(str(learned.project))


def test_a_preview_stops_where_another_camera_is_wanted(session, learned, model):
    session.is_superseded = lambda: True
    with pytest.raises(Cancelled):
        preview(session, asked(learned, model))
    assert not (session.folder / "answers").exists()


@pytest.mark.parametrize(
    ("wrong", "error", "sentence"),
    [
        ({"long_side": "96"}, BadRequest, "long_side = '96' is not of type int"),
        ({"long_side": 0}, BadRequest, "long_side = 0 is out of range"),
        ({"project": None}, BadRequest, "project = None is not of type str"),
        ({"camera": [1]}, BadRequest, "is not of type dict"),
        ({"camera": {"w": 10}}, DataError, "the query.* declares no picture size"),
    ],
)
def test_what_is_wrong_with_a_query_is_named(session, learned, model, wrong, error, sentence):
    with pytest.raises(error, match=sentence):
        preview(session, asked(learned, model, **wrong))


def test_before_palettes_are_learned_the_planes_have_masks_and_no_swatches(session, learned, model, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "no palettes")
    finish_again(project, "geometry", "segmentation")
    answer = preview(session, asked(learned, model, project=str(project), long_side=300))
    planes = read_planes(Path(answer["planes"]))
    frame = of_field(model).render(model.capture.views[0].camera.scaled(300, 200))  # its splats went with the geometry
    assert planes.objects == tuple(model.objects) and planes.palette_weights.shape[1] == 0
    assert np.abs(planes.probabilities - frame.probabilities).max() < 0.02


def test_before_segmentation_the_planes_have_no_objects(session, learned, model, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "geometry only")
    finish_again(project, "geometry")
    for name in ("segmentation", "palette", "recoloring"):
        assert Project(project).finished(name) is None
    answer = preview(session, asked(learned, model, project=str(project), long_side=32))
    planes = read_planes(Path(answer["planes"]))
    assert planes.objects == () and planes.palette_weights.shape == (0, 0, 21, 32)
    assert planes.base.std() > 0


def test_a_warm_job_answers_reloads_what_changed_and_ends_with_its_input(learned, model, tmp_path):
    job = tmp_path / "job"
    Request("warm", learned.project, {"threads": 1, "device": "cpu"}).write(job)
    with (job / "engine.log").open("w") as log:
        child = subprocess.Popen(
            [sys.executable, "-I", str(ROOT / "karf_engine"), "run", str(job)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
            text=True,
        )
    reader, events = EventReader(job), []
    for number, side in ((1, 24), (2, 48)):
        child.stdin.write(Query(number, "preview", asked(learned, model, long_side=side)).encode() + "\n")
        child.stdin.flush()
        end = time.monotonic() + 120
        while not any(event.kind in ("answer", "refused") and event["id"] == number for event in events):
            assert time.monotonic() < end and child.poll() is None, (job / "engine.log").read_text()
            events += reader.poll()
            time.sleep(0.02)
    child.stdin.close()
    assert child.wait(30) == 0
    events += reader.poll()
    assert [event.kind for event in events] == ["hello", "answer", "answer", "done"]
    assert [event["size"] for event in events[1:3]] == [[24, 16], [48, 32]]
