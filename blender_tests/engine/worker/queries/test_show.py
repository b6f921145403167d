"""The recolored picture of any camera, asked of the engine as Blender asks it."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from blender_tests.engine.conftest import finish_again, of_field
from karf_engine.capture.transforms import camera_to_json
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.export.cryptomatte import channels, header
from karf_engine.palettes.palette import edit_to_json
from karf_engine.recolor.frames import remove_background
from karf_engine.recolor.model import Model
from karf_engine.worker.queries.renders import show
from karf_engine.worker.queries.session import Session


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project)


@pytest.fixture(scope="module")
def camera(model):
    return model.capture.views[0].camera.scaled(90, 60)


@pytest.fixture(scope="module")
def edit(model):
    name = model.objects[0]
    return model.edit().swatch(name, 1, (0.1, 0.9, 0.3))


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


@pytest.fixture
def asked(learned, camera, edit):
    return {"project": str(learned.project), "camera": camera_to_json(camera), "edit": edit_to_json(edit)}


def arrays_of(answer):
    data = Path(answer["pixels"]).read_bytes()
    found = {}
    for name, placed in answer["arrays"].items():
        count = int(np.prod(placed["shape"]))
        found[name] = np.frombuffer(data, placed["dtype"], count, placed["offset"]).reshape(placed["shape"])
    return found


def test_the_color_is_what_the_model_shows_with_the_edit(session, asked, model, camera, edit):
    answer = show(session, asked)
    assert list(answer["arrays"]) == ["color"] and answer["size"] == [90, 60] and answer["seconds"] > 0
    assert np.array_equal(arrays_of(answer)["color"], model.render_recolored(camera, edit))
    assert np.abs(model.render_recolored(camera, edit) - model.render_recolored(camera, model.edit())).max() > 0.1


@pytest.mark.parametrize("source", ["splats", "field"])
def test_edges_are_those_of_the_whole_frame_whatever_it_is_made_of(
    session, asked, model, camera, edit, source, monkeypatch
):
    if source == "field":
        monkeypatch.setattr(session, "model", lambda project: of_field(model))
        monkeypatch.setattr("karf_engine.worker.queries.renders.BAND_RAYS", 1000)
    known, name = session.model(asked["project"]), model.objects[0]
    shaped = edit.edge(name, choke=-3, feather=8)
    asked = asked | {"edit": edit_to_json(shaped)}
    frame = known.render(camera)
    whole = known.composite(frame, shaped)
    assert np.abs(whole - known.composite(frame, edit)).max() > 0.02
    for passes in (["color"], ["color", "weights"]):
        found = arrays_of(show(session, asked | {"passes": passes}))
        tolerance = 0.03 if source == "splats" and passes == ["color"] else 1e-5  # baked, as without edges
        np.testing.assert_allclose(found["color"], whole, atol=tolerance)
    np.testing.assert_allclose(found["weights"], known.with_edges(frame, shaped.edges).palette_weights, atol=1e-5)
    if source == "field":
        assert np.array_equal(known.render_recolored(camera, shaped), whole)


def test_without_an_edit_it_is_the_scene_as_learned(session, asked, model, camera):
    color = arrays_of(show(session, asked | {"edit": None}))["color"]
    assert np.array_equal(color, model.render_recolored(camera, model.edit()))


def test_before_palettes_are_learned_it_is_the_scene_as_learned(session, asked, learned, camera, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "geometry only")
    finish_again(project, "geometry")
    color = arrays_of(show(session, asked | {"project": str(project)}))["color"]
    assert np.array_equal(color, Model.load(project).render(camera).base)


def test_what_no_photo_shows_fades_unless_it_is_asked_for(session, asked, model, camera):
    from_behind = replace(camera, camera_to_world=np.diag([1.0, -1, -1, 1]) @ camera.camera_to_world)
    asked = asked | {"camera": camera_to_json(from_behind), "edit": None, "passes": ["color", "seen"]}
    found = {each: arrays_of(show(session, asked | {"unseen": each})) for each in ("faded", "shown")}
    seen = found["faded"]["seen"]
    assert np.array_equal(seen, found["shown"]["seen"]) and seen.min() < 0.1
    assert np.array_equal(arrays_of(show(session, asked))["color"], found["faded"]["color"])
    unknown = seen < 0.1
    faded, shown = (np.abs(found[each]["color"][unknown] - 0.5).max() for each in ("faded", "shown"))
    assert faded < 0.06 and shown > 0.3


def test_passes_are_those_of_the_frame(session, asked, model, camera, edit):
    passes = ["color", "alpha", "depth", "cryptomatte"]
    answer = show(session, asked | {"passes": passes, "cryptomatte": "Layer.CryptoObject"})
    found, frame = arrays_of(answer), model.render(camera)
    assert list(found) == passes
    expected = remove_background(model.composite(frame, edit), frame.opacity, model.render_background(camera))
    assert np.allclose(np.dstack([found["color"], found["alpha"]]), expected, atol=1e-6)
    is_covered = frame.opacity >= 0.5
    assert np.allclose(found["depth"][is_covered], frame.depth[is_covered], atol=1e-6)
    assert is_covered.any() and not found["depth"][~is_covered].any()
    layers = channels(model.objects, frame.probabilities)
    for number, name in enumerate(layers):
        assert np.array_equal(found["cryptomatte"][number // 4, ..., number % 4], layers[name])
    assert answer["metadata"] == header(model.objects, "Layer.CryptoObject")


def test_it_stops_where_another_picture_is_wanted(session, asked):
    session.is_superseded = lambda: True
    with pytest.raises(Cancelled):
        show(session, asked)
    assert not (session.folder / "answers").exists()


@pytest.mark.parametrize(
    ("wrong", "error", "sentence"),
    [
        ({"project": None}, BadRequest, "project = None is not of type str"),
        ({"camera": [1]}, BadRequest, "is not of type dict"),
        ({"camera": {"w": 10}}, DataError, "the query.* declares no picture size"),
        ({"passes": ["Z"]}, BadRequest, "no passes"),
        ({"edit": [1]}, BadRequest, "edit = .* is not of type dict"),
        ({"edit": {"objects": {"cat": {"colors": []}}}}, DataError, "the query edits the unknown object 'cat'"),
    ],
)
def test_what_is_wrong_with_a_query_is_named(session, asked, wrong, error, sentence):
    with pytest.raises(error, match=sentence):
        show(session, asked | wrong)
