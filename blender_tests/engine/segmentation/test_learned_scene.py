"""What segmentation is given of a learned scene: its surface in points, and a report of what came out."""

import json
import shutil
from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

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


def test_the_surface_has_no_more_points_than_rays_can_fill(learned, monkeypatch):
    project = Project(learned.project)
    settings = from_dict(project.state()["settings"])
    field = load_scene(project.geometry_file).field
    capture = capture_from_json(read_json(project.capture_file, "capture"), project.capture_file)
    masks = find_masks(project.masks_folder, capture)
    views = load_masked_views(masks, capture.split("train"), settings.geometry.long_side, settings.segmentation)
    progress = Progress(lambda *_, **__: None, lambda: False, "surface", views.n_pixels)
    cached = cache_views(field, views, settings.segmentation.samples_per_ray, progress)
    fine = surface_points(cached, field.voxel)
    assert fine.spacing == field.voxel
    monkeypatch.setattr(surface_points_module, "MAX_POINTS", len(fine) // 4)
    coarse = surface_points(cached, field.voxel)
    assert coarse.spacing == pytest.approx(2 * fine.spacing, rel=0.01)
    assert len(fine) / 6 < len(coarse) < len(fine) / 2


def test_views_are_those_asked_for_and_then_the_farthest(learned):
    project = Project(learned.project)
    capture = capture_from_json(read_json(project.capture_file, "capture"), project.capture_file)
    train = capture.split("train")
    line = [replace(train[0], name=f"v{x}", camera=_moved(train[0].camera, x)) for x in (0.0, 1.0, 2.0, 5.0)]
    assert [view.name for view in farthest_point_views(line, ["v2.0"], 3)] == ["v2.0", "v5.0", "v0.0"]
    assert [view.name for view in farthest_point_views(line, [], 2)] == ["v0.0", "v5.0"]
    assert len(farthest_point_views(line, [], 9)) == 4


def _moved(camera, x):
    pose = camera.camera_to_world.copy()
    pose[:3, 3] = [x, 0, 0]
    return replace(camera, camera_to_world=pose)


def test_a_report_is_read_as_it_was_written(learned, tmp_path):
    path = shutil.copyfile(Project(learned.project).segmentation_report, tmp_path / "segmentation.json")
    report = SegmentationReport.read(path)
    assert set(report.masked_views) < set(report.views) and report.objects == ["ball", "block"]
    report.write(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_the_views_to_mark_next_are_unmarked_ones_and_the_best_comes_first(learned):
    report = SegmentationReport.read(Project(learned.project).segmentation_report)
    found = report.suggestions.scores
    assert found and set(found) <= set(report.views) - set(report.masked_views)
    scores = list(found.values())
    assert scores == sorted(scores, reverse=True)


def test_that_any_view_helps_is_said_beside_the_views(learned, tmp_path, capsys):
    written = read_json(Project(learned.project).segmentation_report, "report")
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    for any_view_helps in (True, False):
        write_json(project.segmentation_report, written | {"any_view_helps": any_view_helps})
        assert main(["segmentation", str(project.folder), "--suggest"]) == 0
        said = capsys.readouterr().out
        assert next(iter(written["suggestions"])) in said
        assert ("Any view helps about as much." in said) == any_view_helps


def test_reports_of_before_there_were_suggestions_have_none(learned, tmp_path):
    content = json.loads(Project(learned.project).segmentation_report.read_text())
    del content["suggestions"], content["any_view_helps"]
    path = tmp_path / "segmentation.json"
    path.write_text(json.dumps(content))
    assert SegmentationReport.read(path).suggestions == Suggestions({}, any_view_helps=False)


@pytest.mark.parametrize(
    "key",
    ["objects", "precision", "iou_with_marks", "views", "marked", "surface_points", "suggestions", "any_view_helps"],
)
@pytest.mark.parametrize("value", [None, -3, "ball", [{}], {"ball": float("nan")}, {"ball": 2, "block": 0.5}])
def test_a_report_of_other_values_is_refused_in_a_sentence(learned, tmp_path, key, value):
    content = json.loads(Project(learned.project).segmentation_report.read_text())
    path = tmp_path / "segmentation.json"
    path.write_text(json.dumps(content | {key: value}))
    with pytest.raises(DataError) as caught:
        SegmentationReport.read(path)
    assert "segmentation.json" in caught.value.sentence and caught.value.hint
