"""The colors of the recolored Gaussians, as an object of another program that shows them asks for them."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("torch")
pytest.importorskip("numba")

from blender_tests.engine.conftest import finish_again
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.palettes.palette import edit_to_json
from karf_engine.recolor.model import Model
from karf_engine.splats.kernels.arrays import COLOR
from karf_engine.splats.similarity import transform_gaussians
from karf_engine.worker.queries.renders import harmonics
from karf_engine.worker.queries.session import Session

MOVED = np.array([[0, -2.0, 0, 5], [0, 0, -2, 1], [2, 0, 0, 0], [0, 0, 0, 1]])  # turned, twice as large, shifted


@pytest.fixture(scope="module")
def model(learned):
    return Model.load(learned.project)


@pytest.fixture(scope="module")
def edit(model):
    return model.edit().swatch("ball", 1, (0.1, 0.2, 0.9))


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path, threads=1, device="cpu")


@pytest.fixture
def asked(learned, edit):
    return {"project": str(learned.project), "edit": edit_to_json(edit)}


def colors_of(answer):
    placed = answer["arrays"]["harmonics"]
    assert placed["offset"] == 0 and list(answer["arrays"]) == ["harmonics"]
    return np.fromfile(Path(answer["pixels"]), placed["dtype"]).reshape(placed["shape"])


def points_of(table, count):
    rows = np.linspace(0, count - 1, 20).astype(int)
    return {"count": count, "rows": rows.tolist(), "positions": table[rows, :3].tolist()}


def test_they_are_the_recolored_table_row_by_row(session, asked, model, edit):
    answer = harmonics(session, asked)
    found = colors_of(answer)
    assert_array_equal(found, model.recolored_splats(edit).table[:, COLOR:])
    assert answer["n_solid"] == model.splats.n_foreground and answer["seconds"] >= 0
    assert (found != model.splats.table[:, COLOR:]).any()


def test_without_an_edit_they_are_as_learned(session, asked, model):
    assert_array_equal(colors_of(harmonics(session, asked | {"edit": None})), model.splats.table[:, COLOR:])


def test_before_palettes_are_learned_they_are_as_learned(session, asked, learned, model, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "without palettes")
    finish_again(project, "segmentation")
    found = colors_of(harmonics(session, asked | {"project": str(project)}))
    assert_array_equal(found, model.splats.table[:, COLOR:])


@pytest.mark.parametrize("is_solid", [False, True])
def test_an_object_gets_as_many_as_it_has_points(session, asked, model, edit, is_solid):
    count = model.splats.n_foreground if is_solid else len(model.splats)
    found = colors_of(harmonics(session, asked | {"points": points_of(model.splats.table, count)}))
    assert_array_equal(found, model.recolored_splats(edit).table[:count, COLOR:])


def test_they_are_turned_as_the_object_is(session, asked, model, edit):
    there = transform_gaussians(model.recolored_splats(edit), MOVED).table
    found = colors_of(harmonics(session, asked | {"points": points_of(there, len(there))}))
    assert_allclose(found, there[:, COLOR:], atol=2e-5)
    assert found.shape[1] > 3 and (found != model.recolored_splats(edit).table[:, COLOR:]).any()


def test_it_stops_where_another_edit_is_wanted(session, asked):
    session.is_superseded = lambda: True
    with pytest.raises(Cancelled):
        harmonics(session, asked)
    assert not (session.folder / "answers").exists()


def test_another_number_of_points_is_refused_with_the_numbers(session, asked, model):
    with pytest.raises(BadRequest, match=f"7 points, and the scene {len(model.splats)} splats"):
        harmonics(session, asked | {"points": points_of(model.splats.table, 7)})


@pytest.mark.parametrize(
    "wrong",
    [
        {"positions": np.random.default_rng(0).normal(size=(20, 3)).tolist()},
        {"positions": [[0, 0, 0]]},
        {"rows": [10**6] * 20},
        {"rows": None},
    ],
)
def test_other_points_are_refused(session, asked, model, wrong):
    points = points_of(model.splats.table, len(model.splats)) | wrong
    with pytest.raises(BadRequest, match="not where the scene's splats are"):
        harmonics(session, asked | {"points": points})


@pytest.mark.parametrize(
    ("wrong", "error", "sentence"),
    [
        ({"project": None}, BadRequest, "project = None is not of type str"),
        ({"edit": [1]}, BadRequest, "edit = .* is not of type dict"),
        ({"edit": {"objects": {"cat": {"colors": []}}}}, DataError, "the query edits the unknown object 'cat'"),
        ({"points": [1]}, BadRequest, "points = .* is not of type dict"),
        ({"points": {}}, BadRequest, "count = None is not of type int"),
    ],
)
def test_what_is_wrong_with_a_query_is_named(session, asked, wrong, error, sentence):
    with pytest.raises(error, match=sentence):
        harmonics(session, asked | wrong)


def test_a_project_without_splats_says_so(session, asked, learned, tmp_path):
    project = shutil.copytree(learned.project, tmp_path / "without splats")
    finish_again(project, "geometry")
    with pytest.raises(BadRequest, match="shows no splats"):
        harmonics(session, asked | {"project": str(project)})
