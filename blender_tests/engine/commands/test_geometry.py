"""The geometry stage on open scenes: sparse points, held-out views, warnings and memory."""

import os
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.conftest import QUICK as BOX
from blender_tests.engine.fields.fitting import points_on_the_still_life
from blender_tests.engine.peak import peak_of
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

QUICK = """
    geometry.space=contraction geometry.features=4 geometry.open.samples=4000
    geometry.open.levels=[{"voxels":12,"iterations":40,"step":1},{"voxels":16,"iterations":8,"step":1}]
""".split()


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The still life before a sky, with sparse points."""
    folder = tmp_path_factory.mktemp("capture")
    rig = cameras(16)
    photos = [take_photo(camera, sky=True) for camera in rig]
    paths = [folder / f"{number:02d}.png" for number in range(16)]
    for path, photo in zip(paths, photos, strict=True):
        write_png(path, photo.color)
    views = [View(path.stem, path.stem, camera, path, "train") for path, camera in zip(paths, rig, strict=True)]
    return hold_out(Capture(folder, "made", tuple(views), points=points_on_the_still_life(rig, photos)), 8)


@pytest.fixture
def learn(monkeypatch, tmp_path):
    """Learn a capture into the test's project; returns the job's events and the stage's summary."""

    def learn(capture, **more):
        monkeypatch.setattr(geometry, "open_capture", lambda path: capture)
        project, events = Project(tmp_path / "project"), Events()
        options = GeometryOptions.of(capture=capture.source, project=project.folder, overrides=QUICK, threads=1, **more)
        geometry.run(options, events, lambda: False)
        return events, project.finished("geometry")

    return learn


@pytest.fixture
def job(tmp_path, events):
    settings = with_overrides(preset("demo"), QUICK)
    return make_job(Project(tmp_path), Options(threads=1), settings, events, lambda: False)


def test_project_keeps_holdout_and_points_and_reports_held_out_views(capture, learn):
    bare = replace(capture, views=tuple(replace(view, split="train") for view in capture.views), holdout=0)
    moved = replace(bare, points=replace(bare.points, positions=bare.points.positions + 0.01))
    runs = [(bare, {"holdout": 8}), (bare, {}), (bare, {"holdout": 0}), (moved, {"holdout": 0})]
    learned = [learn(each, **options) for each, options in runs]
    assert [facts["holdout"] for _, facts in learned] == [8, 8, 0, 0]
    assert [events.is_done_already("geometry") for events, _ in learned] == [False, True, False, False]
    (events, facts), *_, (other_events, other_facts) = learned
    assert facts["space"] == "contraction" and 1 < facts["pixels_per_voxel"] < 6
    assert len(facts["held_out"]) == 2 and all(5 < worst <= mean < 40 for mean, worst in facts["held_out"])
    assert events.values("warning", "code") == ["detail"]  # 16 voxels are few
    assert other_facts["held_out"] == []
    assert any("new views" in (text or "") for text in other_events.values("stage", "text"))  # which nothing measures


def test_masked_photos_are_trained_on_and_later_masks_keep_geometry(capture, learn, tmp_path):
    project = Project(tmp_path / "project")
    first, second = (view.name for view in capture.split("test"))
    write_png(tmp_path / "masks" / "ball" / f"{first}.png", np.ones((32, 32), bool))
    learn(capture, masks=str(tmp_path / "masks"))
    assert [view.name for view in read_capture(project).split("test")] == [second]
    write_png(project.corrections_folder / "ball" / f"{second}.png", np.ones((32, 32), bool))
    events, _ = learn(capture)
    assert events.is_done_already("geometry")


def test_gains_of_held_out_photos_come_from_the_scene(capture, learn, monkeypatch, tmp_path):
    monkeypatch.setattr(voxel_fit, "estimate_photo_gains", lambda *_: np.full((14, 3), 1.25, np.float32))
    monkeypatch.setattr(voxel_fit, "COMPARED_AFTER", 0)
    monkeypatch.setattr(geometry, "gains_from_render", lambda scene, camera, photo: (0.5, 1.0, 2.0))
    learn(capture)
    learned = read_capture(Project(tmp_path / "project"))
    assert {view.gains for view in learned.split("train")} == {(1.25, 1.25, 1.25)}
    assert {view.gains for view in learned.split("test")} == {(0.5, 1.0, 2.0)}


def test_training_points_are_those_seen_by_training_photos(capture, job):
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


@pytest.mark.parametrize("reason", ["pycolmap", "no film"], ids=["no package", "no match"])
def test_failed_triangulation_gives_a_warning(capture, monkeypatch, job, events, reason):
    monkeypatch.setattr(geometry, "triangulate", Mock(side_effect=KarfError("pycolmap failed: no film.", "")))
    monkeypatch.setattr(geometry, "find_spec", lambda name: None if reason == "pycolmap" else object())
    bare = replace(capture, points=None)
    assert geometry.training_points(job, bare, load_views(bare.split("train"), 64), "opaque") is None
    assert events.values("warning", "code") == ["points"] and reason in events.values("warning", "sentence")[0]


def test_worsening_held_out_views_give_a_warning(monkeypatch, job, events):
    scores = []
    for values in ([22.0, 24.0], [21.8, 24.0], [20.0, 23.0]):
        monkeypatch.setattr(geometry, "psnr_of_views", lambda scene, dataset, seed, values=values: values)
        geometry.validate(job, None, None, scores)
    assert scores == [[23.0, 22.0], [22.9, 21.8], [21.5, 20.0]]
    assert events.values("warning", "code") == ["held_out"]


def test_coarse_voxels_give_a_warning_with_a_better_number(capture, job, events):
    training_images = load_views(capture.split("train"), 64)
    for pixels, space in ((1.2, "contraction"), (5.0, "contraction"), (5.0, "box")):
        geometry.warn_of_lost_detail(job, pixels, training_images, space)
    assert events.values("warning", "code") == ["detail", "detail"]
    opened, boxed = events.values("warning", "sentence")
    assert "5.0 pixels" in opened and "geometry.open.levels ends at 16 voxels; 40 would do" in opened
    assert "geometry.levels ends at 136 voxels; 340 would do" in boxed


# a field of some 300 MB with its moments, in a few seconds
FINE_LEVEL = 'geometry.levels=[{"voxels": 128, "iterations": 2, "step": 1.0}]'
LARGE = (FINE_LEVEL, "geometry.samples=4000", "geometry.features=12")
LEARN = (
    "import gc; import karf_engine as karf; gc.disable(); import torch, karf_engine.commands.geometry; "
    "[karf.learn_geometry(sys.argv[1], project=Path(sys.argv[2], str(number)), overrides=sys.argv[4:], threads=1) "
    "for number in range(int(sys.argv[3]))]"
)


@pytest.mark.skipif(os.name == "nt", reason="the peak is read from /proc")
def test_memory_peak_of_three_captures_is_that_of_one(still_life, tmp_path):
    peaks = (peak_of(LEARN, still_life.capture, tmp_path / str(count), count, *BOX, *LARGE) for count in (0, 1, 3))
    none, one, three = peaks
    assert one > none + 100e6 and three - none <= 1.2 * (one - none), (none, one, three)
