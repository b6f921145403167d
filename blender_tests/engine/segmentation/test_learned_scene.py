"""Surface points, view choice and the segmentation report of a learned scene."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from blender_tests.engine.reference.still_life import BALL_CENTER, BALL_RADIUS
from karf_engine.capture.capture import capture_from_json
from karf_engine.cli import main
from karf_engine.compute.progress import Progress
from karf_engine.errors import DataError
from karf_engine.fields.files import load_scene
from karf_engine.io.files import read_json, write_json
from karf_engine.project import Project
from karf_engine.project.settings import from_dict
from karf_engine.segmentation import surface_points as surface_points_module
from karf_engine.segmentation.coarse_masks import find_masks
from karf_engine.segmentation.report import SegmentationReport, Suggestions
from karf_engine.segmentation.surface_points import surface_points
from karf_engine.segmentation.views import cache_views, farthest_point_views, load_masked_views

KEYS = "objects precision iou_with_marks views marked surface_points suggestions any_view_helps centers".split()


@pytest.fixture(scope="module")
def project(learned):
    return Project(learned.project)


@pytest.fixture(scope="module")
def capture(project):
    return capture_from_json(read_json(project.capture_file, "capture"), project.capture_file)


def test_surface_points_are_limited_by_a_coarser_spacing(project, capture, monkeypatch):
    settings = from_dict(project.state()["settings"])
    field, masks = load_scene(project.geometry_file).field, find_masks(project.masks_folder, capture)
    views = load_masked_views(masks, capture.split("train"), settings.geometry.long_side, settings.segmentation)
    progress = Progress(lambda *_, **__: None, lambda: False, "surface", views.n_pixels)
    cached = cache_views(field, views, settings.segmentation.samples_per_ray, progress)
    fine = surface_points(cached, field.voxel)
    assert fine.spacing == field.voxel
    monkeypatch.setattr(surface_points_module, "MAX_POINTS", len(fine) // 4)
    coarse = surface_points(cached, field.voxel)
    assert coarse.spacing == pytest.approx(2 * fine.spacing, rel=0.01)
    assert len(fine) / 6 < len(coarse) < len(fine) / 2


def test_views_are_the_given_ones_then_the_farthest(capture):
    first, line = capture.split("train")[0], []
    for x in (0.0, 1.0, 2.0, 5.0):
        pose = first.camera.camera_to_world.copy()
        pose[:3, 3] = [x, 0, 0]
        line.append(replace(first, name=f"v{x}", camera=replace(first.camera, camera_to_world=pose)))
    assert [view.name for view in farthest_point_views(line, ["v2.0"], 3)] == ["v2.0", "v5.0", "v0.0"]
    assert [view.name for view in farthest_point_views(line, [], 2)] == ["v0.0", "v5.0"]
    assert len(farthest_point_views(line, [], 9)) == 4


def test_report_round_trips_and_ranks_unmarked_views(project, tmp_path):
    report = SegmentationReport.read(project.segmentation_report)
    assert set(report.masked_views) < set(report.views) and report.objects == ["ball", "block"]
    scores = report.suggestions.scores
    assert scores and set(scores) <= set(report.views) - set(report.masked_views)
    assert list(scores.values()) == sorted(scores.values(), reverse=True)
    report.write(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == project.segmentation_report.read_bytes()
    content = json.loads(project.segmentation_report.read_text())
    del content["suggestions"], content["any_view_helps"]  # as in older reports
    (tmp_path / "older.json").write_text(json.dumps(content))
    assert SegmentationReport.read(tmp_path / "older.json").suggestions == Suggestions({}, any_view_helps=False)


def test_report_says_where_the_objects_are(project):
    report = SegmentationReport.read(project.segmentation_report)
    assert report.centers.keys() == {"ball", "block"}
    np.testing.assert_allclose(report.centers["ball"], BALL_CENTER, atol=BALL_RADIUS / 2)


def test_suggestions_say_whether_any_view_helps(learned, tmp_path, capsys):
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    written = read_json(project.segmentation_report, "report")
    for any_view_helps in (True, False):
        write_json(project.segmentation_report, written | {"any_view_helps": any_view_helps})
        assert main(["segmentation", str(project.folder), "--suggest"]) == 0
        output = capsys.readouterr().out
        assert next(iter(written["suggestions"])) in output
        assert ("Any view helps about as much." in output) == any_view_helps


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("value", [None, -3, "ball", [{}], {"ball": float("nan")}, {"ball": 2, "block": 0.5}])
def test_report_with_wrong_values_is_rejected(project, tmp_path, key, value):
    path = tmp_path / "segmentation.json"
    path.write_text(json.dumps(json.loads(project.segmentation_report.read_text()) | {key: value}))
    with pytest.raises(DataError) as caught:
        SegmentationReport.read(path)
    assert "segmentation.json" in caught.value.sentence and caught.value.hint
