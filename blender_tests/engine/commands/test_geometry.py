"""The geometry stage on open scenes: where its sparse points come from, and what it says of held-out views."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

from blender_tests.engine.fields.voxels.test_fit_open import points_on_the_still_life
from blender_tests.engine.reference.still_life import cameras, take_photo
from karf_engine.capture.capture import Capture, View, hold_out
from karf_engine.capture.training_images import load_views
from karf_engine.commands import geometry
from karf_engine.commands.job import make_job
from karf_engine.commands.options import GeometryOptions
from karf_engine.errors import KarfError
from karf_engine.fields.voxels import fit as voxel_fit
from karf_engine.io.images import write_png
from karf_engine.io.options import Options
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.project.settings import preset, with_overrides

QUICK = [
    "geometry.space=contraction",
    "geometry.features=4",
    "geometry.open.samples=4000",
    'geometry.open.levels=[{"voxels": 12, "iterations": 40, "step": 1}, {"voxels": 16, "iterations": 8, "step": 1}]',
]


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The still life before a sky, with sparse points."""
    folder = tmp_path_factory.mktemp("capture")
    rig = cameras(16)
    photos = [take_photo(camera, sky=True) for camera in rig]
    views = []
    for number, photo in enumerate(photos):
        path = folder / f"{number:02d}.png"
        write_png(path, photo.color)
        views.append(View(path.stem, path.stem, photo.camera, path, "train"))
    return hold_out(Capture(folder, "made", tuple(views), points=points_on_the_still_life(rig, photos)), 8)


@pytest.fixture
def events():
    return []


def job_on(folder, events):
    settings = with_overrides(preset("demo"), QUICK)
    return make_job(
        Project(folder), Options(threads=1), settings, lambda kind, /, **v: events.append((kind, v)), lambda: False
    )


def learn(monkeypatch, capture, folder, events, **more):
    monkeypatch.setattr(geometry, "open_capture", lambda path: capture)
    options = GeometryOptions.of(capture=capture.source, project=folder, overrides=QUICK, threads=1, **more)
    geometry.run(options, lambda kind, /, **values: events.append((kind, values)), lambda: False)
    return Project(folder).finished("geometry")


def warnings(events):
    return [values["code"] for kind, values in events if kind == "warning"]


def test_the_space_and_how_well_held_out_views_did_are_noted(capture, monkeypatch, tmp_path, events):
    facts = learn(monkeypatch, capture, tmp_path / "project", events)
    assert facts["space"] == "contraction"
    assert len(facts["held_out"]) == 2
    assert all(5 < worst <= mean < 40 for mean, worst in facts["held_out"])
    assert 1 < facts["pixels_per_voxel"] < 6
    assert warnings(events) == ["detail"]  # 16 voxels are few


def all_to_learn(capture):
    return replace(capture, views=tuple(replace(view, split="train") for view in capture.views), holdout=0)


def test_without_held_out_photos_it_is_said_what_is_not_measured(capture, monkeypatch, tmp_path, events):
    facts = learn(monkeypatch, all_to_learn(capture), tmp_path / "project", events)
    assert (facts["holdout"], facts["held_out"]) == (0, [])
    assert any("new views" in values.get("text", "") for kind, values in events if kind == "stage")


def test_a_project_keeps_the_holdout_that_it_was_learned_with(capture, monkeypatch, tmp_path):
    bare, events = all_to_learn(capture), [[], [], []]
    assert learn(monkeypatch, bare, tmp_path / "project", events[0], holdout=8)["holdout"] == 8
    assert learn(monkeypatch, bare, tmp_path / "project", events[1])["holdout"] == 8
    assert learn(monkeypatch, bare, tmp_path / "project", events[2], holdout=0)["holdout"] == 0
    done = [("stage", {"name": "geometry", "text": "already done"}) in told for told in events]
    assert done == [False, True, False]


def test_projects_of_before_there_was_a_choice_have_held_out_every_eighth_photo(tmp_path):
    project = Project(tmp_path / "project")
    assert project.holdout() == 0
    project.create("capture")
    assert project.holdout() == 0
    project.finish("geometry", "fingerprint")
    assert project.holdout() == 8


def test_a_marked_photo_is_learned_from_and_a_later_mark_asks_for_no_new_geometry(capture, monkeypatch, tmp_path):
    project, told = Project(tmp_path / "project"), []
    first, second = (view.name for view in capture.split("test"))
    write_png(tmp_path / "masks" / "ball" / f"{first}.png", np.ones((32, 32), bool))
    learn(monkeypatch, capture, project.folder, [], masks=str(tmp_path / "masks"))
    assert [view.name for view in read_capture(project).split("test")] == [second]
    write_png(project.corrections_folder / "ball" / f"{second}.png", np.ones((32, 32), bool))
    learn(monkeypatch, capture, project.folder, told)
    assert ("stage", {"name": "geometry", "text": "already done"}) in told


def test_where_photos_differ_those_that_are_held_out_are_compared_with_the_scene(capture, monkeypatch, tmp_path):
    told = np.full((14, 3), 1.25, np.float32)
    monkeypatch.setattr(voxel_fit, "estimate_photo_gains", lambda *_: told)
    monkeypatch.setattr(voxel_fit, "COMPARED_AFTER", 0)
    monkeypatch.setattr(geometry, "gains_from_render", lambda scene, camera, photo: (0.5, 1.0, 2.0))
    learn(monkeypatch, capture, tmp_path / "project", [])
    learned = read_capture(Project(tmp_path / "project"))
    assert {view.gains for view in learned.split("train")} == {(1.25, 1.25, 1.25)}
    assert {view.gains for view in learned.split("test")} == {(0.5, 1.0, 2.0)}


def test_other_sparse_points_are_another_scene_to_learn(capture, monkeypatch, tmp_path):
    first, again, other = [], [], []
    learn(monkeypatch, capture, tmp_path / "project", first)
    learn(monkeypatch, capture, tmp_path / "project", again)
    moved = replace(capture, points=replace(capture.points, positions=capture.points.positions + 0.01))
    learn(monkeypatch, moved, tmp_path / "project", other)
    done = [("stage", {"name": "geometry", "text": "already done"}) in events for events in (first, again, other)]
    assert done == [False, True, False]


def test_the_captures_own_points_are_used_as_the_training_photos_saw_them(capture, tmp_path, events):
    job = job_on(tmp_path, events)
    training_images = load_views(capture.split("train"), 64)
    points = geometry.training_points(job, capture, training_images, "opaque")
    test = [number for number, view in enumerate(capture.views) if view.split == "test"]
    assert len(points) == len(capture.points)
    assert len(points.view) == (~np.isin(capture.points.view, test)).sum() > 0
    for number, training_image in enumerate(training_images):
        own = points.view == number
        pixels, _ = training_image.camera.project(points.positions[points.point[own]])
        np.testing.assert_allclose(pixels, points.pixels[own], atol=1e-3)
    assert geometry.training_points(job, capture, training_images, "alpha") is None


def test_without_pycolmap_a_bare_capture_is_learned_in_a_box_with_a_warning(capture, monkeypatch, tmp_path, events):
    monkeypatch.setattr(geometry, "find_spec", lambda name: None)
    bare = replace(capture, points=None)
    training_images = load_views(bare.split("train"), 64)
    assert geometry.training_points(job_on(tmp_path, events), bare, training_images, "opaque") is None
    assert warnings(events) == ["points"]


def test_a_search_for_points_that_fails_is_a_warning(capture, monkeypatch, tmp_path, events):
    def fail(*_):
        raise KarfError("pycolmap failed: no film.", "")

    monkeypatch.setattr(geometry, "triangulate", fail)
    monkeypatch.setattr(geometry, "find_spec", lambda name: object())
    bare = replace(capture, points=None)
    assert (
        geometry.training_points(job_on(tmp_path, events), bare, load_views(bare.split("train"), 64), "opaque") is None
    )
    assert warnings(events) == ["points"]
    assert "no film" in events[-1][1]["sentence"]


def test_held_out_views_that_become_worse_are_warned_of(monkeypatch, tmp_path, events):
    job, scores = job_on(tmp_path, events), []
    for values in ([22.0, 24.0], [21.8, 24.0], [20.0, 23.0]):
        monkeypatch.setattr(geometry, "psnr_of_views", lambda scene, dataset, seed, values=values: values)
        geometry.validate(job, None, None, scores)
    assert scores == [[23.0, 22.0], [22.9, 21.8], [21.5, 20.0]]
    assert warnings(events) == ["held_out"]


def test_voxels_that_lose_most_of_the_photos_are_warned_of_with_the_number_that_would_do(capture, tmp_path, events):
    job, training_images = job_on(tmp_path, events), load_views(capture.split("train"), 64)
    geometry.warn_of_lost_detail(job, 1.2, training_images, "contraction")
    assert not warnings(events)
    geometry.warn_of_lost_detail(job, 5.0, training_images, "contraction")
    assert warnings(events) == ["detail"]
    sentence = events[-1][1]["sentence"]
    assert "5.0 pixels" in sentence and "geometry.open.levels ends at 16 voxels; 40 would do" in sentence
    geometry.warn_of_lost_detail(job, 5.0, training_images, "box")
    assert "geometry.levels ends at 136 voxels; 340 would do" in events[-1][1]["sentence"]
