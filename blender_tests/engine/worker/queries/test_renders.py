"""Queries of Blender for pictures, edit planes and colors of splats."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

from blender_tests.engine.conftest import finish_again, of_field
from blender_tests.engine.worker.queries.conftest import with_arrays
from karf_engine.api import erase_splats
from karf_engine.capture.transforms import camera_to_json
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.export.cryptomatte import channels, header
from karf_engine.palettes.compositing import read_planes
from karf_engine.palettes.palette import edit_to_json
from karf_engine.recolor.frames import remove_background
from karf_engine.recolor.model import Model
from karf_engine.splats.kernels.arrays import COLOR
from karf_engine.splats.similarity import transform_gaussians

MOVED = np.array([[0, -2.0, 0, 5], [0, 0, -2, 1], [2, 0, 0, 0], [0, 0, 0, 1]])  # rotated, scaled by two, shifted


@pytest.fixture(scope="module")
def camera(model):
    return model.capture.views[0].camera.scaled(90, 60)


@pytest.fixture
def show(ask, camera):
    """Ask for a picture of the camera; the answer and its arrays."""

    view = {"camera": camera_to_json(camera)}
    return lambda **options: with_arrays(ask("show", **view | options))


@pytest.fixture
def preview(ask, camera):
    """Ask for planes of the camera; the answer and the planes."""

    defaults = {"camera": camera_to_json(camera.scaled(450, 300)), "long_side": 300}

    def preview(**options):
        answer = ask("preview", **defaults | options)
        return answer, read_planes(Path(answer["planes"]))

    return preview


@pytest.fixture
def harmonics(ask):
    """Ask for colors of splats; the answer and its arrays."""
    return lambda **options: with_arrays(ask("harmonics", **options))


def unfinished(learned, folder, *kept):
    """A copy of the project with only these stages finished."""
    project = shutil.copytree(learned.project, folder / "of fewer stages")
    finish_again(project, *kept)
    return str(project)


def test_shown_color_matches_the_model_with_and_without_edit(show, model, camera, edit):
    answer, found = show()
    assert list(found) == ["color"] and answer["size"] == [90, 60] and answer["seconds"] > 0
    as_learned = model.render_recolored(camera, model.edit())
    assert_array_equal(found["color"], model.render_recolored(camera, edit))
    assert np.abs(found["color"] - as_learned).max() > 0.1
    assert_array_equal(show(edit=None)[1]["color"], as_learned)


def test_erased_splats_are_gone_from_the_next_picture(show, learned, camera, tmp_path):
    project = str(shutil.copytree(learned.project, tmp_path / "erased"))
    before = show(project=project, edit=None)[1]["color"]
    erase_splats(project, boxes=[(9, 0, 0, 9, 0, 9, 0, 0, 0, 0, 9, 0, 0, 0, 0, 1)])
    found = show(project=project, edit=None)[1]["color"]
    assert np.abs(found - before).max() > 0.1
    model = Model.load(project)
    assert_array_equal(found, model.render_recolored(camera, model.edit()))


def test_scene_without_palettes_is_shown_as_learned(show, learned, camera, tmp_path):
    project = unfinished(learned, tmp_path, "geometry")
    assert_array_equal(show(project=project)[1]["color"], Model.load(project).render(camera).base)


@pytest.mark.parametrize("source", ["splats", "field"])
def test_edge_shapes_match_the_whole_frame(show, session, model, camera, edit, source, monkeypatch):
    shown = of_field(model) if source == "field" else model
    monkeypatch.setattr(session, "model", lambda project: shown)
    if source == "field":
        monkeypatch.setattr("karf_engine.worker.queries.renders.BAND_RAYS", 1000)
    shaped = edit.edge("ball", choke=-3, feather=8)
    frame = shown.render(camera)
    whole = shown.composite(frame, shaped)
    assert np.abs(whole - shown.composite(frame, edit)).max() > 0.02
    for passes in (["color"], ["color", "weights"]):
        found = show(edit=edit_to_json(shaped), passes=passes)[1]
        tolerance = 0.03 if source == "splats" and passes == ["color"] else 1e-5  # colors are baked into the splats
        assert_allclose(found["color"], whole, atol=tolerance)
    assert_allclose(found["weights"], shown.with_edges(frame, shaped.edges).palette_weights, atol=1e-5)
    if source == "field":
        assert_array_equal(shown.render_recolored(camera, shaped), whole)


def test_unseen_regions_fade_by_default(show, camera):
    behind = replace(camera, camera_to_world=np.diag([1.0, -1, -1, 1]) @ camera.camera_to_world)
    asked = {"camera": camera_to_json(behind), "edit": None, "passes": ["color", "seen"]}
    faded, shown = (show(**asked, unseen=each)[1] for each in ("faded", "shown"))
    unknown = faded["seen"] < 0.1
    assert_array_equal(faded["seen"], shown["seen"])
    assert_array_equal(show(**asked)[1]["color"], faded["color"])
    assert np.abs(faded["color"][unknown] - 0.5).max() < 0.06 and np.abs(shown["color"][unknown] - 0.5).max() > 0.3


def test_passes_match_the_frame(show, model, camera, edit):
    passes = ["color", "alpha", "depth", "cryptomatte"]
    answer, found = show(passes=passes, cryptomatte="Layer.CryptoObject")
    frame = model.render(camera)
    assert list(found) == passes
    expected = remove_background(model.composite(frame, edit), frame.opacity, model.render_background(camera))
    assert_allclose(np.dstack([found["color"], found["alpha"]]), expected, atol=1e-6)
    is_covered = frame.opacity >= 0.5
    assert_allclose(found["depth"][is_covered], frame.depth[is_covered], atol=1e-6)
    assert is_covered.any() and not found["depth"][~is_covered].any()
    layers = channels(model.objects, frame.probabilities)
    for number, name in enumerate(layers):
        assert_array_equal(found["cryptomatte"][number // 4, ..., number % 4], layers[name])
    assert answer["metadata"] == header(model.objects, "Layer.CryptoObject")


def test_preview_planes_match_the_frame(preview, model, camera):
    answer, planes = preview()
    frame = model.render(camera.scaled(300, 200))
    assert answer["size"] == [300, 200] and planes.base.shape == (200, 300, 3)
    assert planes.objects == tuple(model.objects)
    assert np.abs(planes.palette_weights - frame.palette_weights).max() < 2e-3
    assert np.abs(planes.base / 255 - frame.color).max() < 0.6 / 255


def test_coarse_preview_looks_alike_and_reuses_the_model(preview, model, camera, session, learned):
    _, planes = preview(long_side=96)
    frame = model.render(camera.scaled(96, 64))
    assert np.abs(planes.base / 255 - frame.color).mean() < 1 / 255
    assert np.abs(planes.palette_weights - frame.palette_weights).mean() < 0.02
    assert session.model(str(learned.project)) is session.model(str(learned.project))


@pytest.mark.parametrize("kept", [["geometry", "segmentation"], ["geometry"]])
def test_planes_of_unfinished_projects_lack_swatches_or_objects(preview, learned, model, camera, tmp_path, kept):
    _, planes = preview(project=unfinished(learned, tmp_path, *kept))
    objects = model.objects if "segmentation" in kept else []
    assert planes.objects == tuple(objects) and planes.palette_weights.shape == (len(objects), 0, 200, 300)
    assert planes.base.std() > 0
    if objects:
        frame = of_field(model).render(camera.scaled(300, 200))  # without splats
        assert np.abs(planes.probabilities - frame.probabilities).max() < 0.02


def points_of(table, count):
    rows = np.linspace(0, count - 1, 20).astype(int)
    return {"count": count, "rows": rows.tolist(), "positions": table[rows, :3].tolist()}


def test_harmonics_are_those_of_the_recolored_splats(harmonics, model, edit, learned, tmp_path):
    answer, found = harmonics()
    as_learned, recolored = (splats.table[:, COLOR:] for splats in (model.splats, model.recolored_splats(edit)))
    assert list(found) == ["harmonics"] and answer["arrays"]["harmonics"]["offset"] == 0
    assert answer["n_solid"] == model.splats.n_foreground and answer["seconds"] >= 0
    assert_array_equal(found["harmonics"], recolored)
    assert (recolored != as_learned).any()
    for options in ({"edit": None}, {"project": unfinished(learned, tmp_path, "segmentation")}):
        assert_array_equal(harmonics(**options)[1]["harmonics"], as_learned)
    for count in (len(model.splats), model.splats.n_foreground):
        points = points_of(model.splats.table, count)
        assert_array_equal(harmonics(points=points)[1]["harmonics"], recolored[:count])


def test_harmonics_follow_the_rotation_of_the_points(harmonics, model, edit):
    recolored = model.recolored_splats(edit)
    moved = transform_gaussians(recolored, MOVED).table
    found = harmonics(points=points_of(moved, len(moved)))[1]["harmonics"]
    assert_allclose(found, moved[:, COLOR:], atol=2e-5)
    assert found.shape[1] > 3 and (found != recolored.table[:, COLOR:]).any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"positions": np.random.default_rng(0).normal(size=(20, 3)).tolist()},
        {"positions": [[0, 0, 0]]},
        {"rows": [10**6] * 20},
        {"rows": None},
        {"count": 7},
    ],
)
def test_foreign_points_are_rejected(harmonics, model, wrong):
    splats = len(model.splats)
    words = f"7 points, and the scene {splats} splats" if "count" in wrong else "not where the scene's splats are"
    with pytest.raises(BadRequest, match=words):
        harmonics(points=points_of(model.splats.table, splats) | wrong)


def test_harmonics_without_splats_are_rejected(harmonics, learned, tmp_path):
    with pytest.raises(BadRequest, match="shows no splats"):
        harmonics(project=unfinished(learned, tmp_path, "geometry"))


KINDS = ("show", "preview", "harmonics")


@pytest.mark.parametrize("kind", KINDS)
def test_superseded_query_is_cancelled(kind, request, session):
    session.is_superseded = lambda: True
    with pytest.raises(Cancelled):
        request.getfixturevalue(kind)()
    assert not (session.folder / "answers").exists()


MALFORMED = [
    (KINDS, {"project": None}, BadRequest, "project = None is not of type str"),
    (KINDS[:2], {"camera": [1]}, BadRequest, "is not of type dict"),
    (KINDS[:2], {"camera": {"w": 10}}, DataError, "the query.* declares no picture size"),
    (KINDS[1:2], {"long_side": "96"}, BadRequest, "long_side = '96' is not of type int"),
    (KINDS[1:2], {"long_side": 0}, BadRequest, "long_side = 0 is out of range"),
    (KINDS[:1], {"passes": ["Z"]}, BadRequest, "no passes"),
    (KINDS[::2], {"edit": [1]}, BadRequest, "edit = .* is not of type dict"),
    (KINDS[::2], {"edit": {"objects": {"cat": {"colors": []}}}}, DataError, "the query edits the unknown object 'cat'"),
    (KINDS[2:], {"points": [1]}, BadRequest, "points = .* is not of type dict"),
    (KINDS[2:], {"points": {}}, BadRequest, "count = None is not of type int"),
]


@pytest.mark.parametrize(
    ("kind", "wrong", "error", "sentence"), [(kind, *row) for kinds, *row in MALFORMED for kind in kinds]
)
def test_malformed_queries_are_rejected(request, kind, wrong, error, sentence):
    with pytest.raises(error, match=sentence):
        request.getfixturevalue(kind)(**wrong)
