"""What a project tells of itself: the views to mark next."""

import json

import pytest


@pytest.fixture
def imported(bpy, addon, scene, capture_folder, tmp_path):
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    return scene


def segmented(addon, scene, report):
    project = addon.folders.project_of(scene)
    project.create("capture")
    project.finish("geometry", "g")
    project.finish("segmentation", "s")
    project.segmentation_report.write_text(json.dumps(report))


def test_the_views_to_mark_next_are_those_that_segmentation_named(addon, imported):
    assert addon.disk.read(imported).suggested == ()
    segmented(addon, imported, {"suggestions": {"photo_2": 0.2, "gone": 0.1, "photo_0": 0.1}})
    assert addon.disk.read(imported).suggested == ("photo_2", "photo_0")


@pytest.mark.parametrize("report", [{}, [], {"suggestions": 3}])
def test_a_report_without_any_names_none(addon, imported, report):
    segmented(addon, imported, report)
    assert addon.disk.read(imported).suggested == ()


@pytest.mark.parametrize("told, is_so", [(True, True), (False, False), (3, False), ("yes", False)])
def test_that_any_view_helps_comes_from_the_report_too(addon, imported, told, is_so):
    assert not addon.disk.read(imported).any_view_helps
    segmented(addon, imported, {"any_view_helps": told})
    assert addon.disk.read(imported).any_view_helps is is_so


def test_how_unsure_each_object_is_comes_from_the_report_too(addon, imported):
    segmented(addon, imported, {"unsure": {"pot": {"share": 0.25, "unseen": 0.9}, "mug": {"share": 0, "unseen": 0}}})
    assert addon.disk.read(imported).unsure == (("pot", 0.25, True), ("mug", 0.0, False))


@pytest.mark.parametrize("report", [{}, {"unsure": 3}, {"unsure": {"pot": 1}}, {"unsure": {"pot": {"share": "x"}}}])
def test_a_report_without_doubts_tells_none(addon, imported, report):
    segmented(addon, imported, report)
    assert addon.disk.read(imported).unsure == ()
