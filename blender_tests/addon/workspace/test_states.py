"""Each step shows its state; finished steps fold, the next one opens, and panels opened by hand stay open."""

import os

import numpy as np
import pytest

NEW = dict.fromkeys(("import", "mark", "learn", "edit", "render"), "to do")
DONE = dict.fromkeys(NEW, "done")
IMPORTED = NEW | {"import": "done"}
MARKED = IMPORTED | {"mark": "done"}


@pytest.fixture
def project(addon, learned, tmp_path):
    """The scene's project, segmented by a mask of the pot, tmp_path/masks/pot/photo_0.png, and recolored."""
    addon.images.write_png(tmp_path / "masks" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    learned.karf.masks = str(tmp_path / "masks")
    project = addon.folders.project_of(learned)
    project.finish("segmentation", "fake")
    project.segmentation_file.touch()
    project.finish("recoloring", "fake")
    return project


def kinds(addon, scene):
    return {step: addon.states.state_of(scene, step).kind for step in addon.states.STEPS}


def test_step_is_done_when_its_result_exists(addon, learned):
    assert kinds(addon, learned) == NEW | dict.fromkeys(("import", "learn"), "done")


@pytest.mark.parametrize("mark", ["../masks/pot/photo_0.png", "corrections/pot/photo_0.png", "volumes.json"])
def test_newer_mark_makes_segmentation_stale(addon, learned, project, mark):
    file = project.folder / mark
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    assert kinds(addon, learned)["learn"] == "done"
    later = file.stat().st_mtime + 60
    os.utime(file, (later, later))
    state = addon.states.state_of(learned, "learn")
    assert state.kind == "stale" and "Marks have changed" in state.reason


def test_rerun_stage_makes_later_ones_stale(addon, learned, project):
    assert kinds(addon, learned)["learn"] == "done"
    for stage, reason in (("segmentation", "objects alone"), ("geometry", "scene alone")):
        project.finish(stage, "anew")
        state = addon.states.state_of(learned, "learn")
        assert state.kind == "stale" and reason in state.reason


def test_preset_other_than_the_learned_one_is_shown(addon, learned, monkeypatch):
    monkeypatch.setattr(addon.disk, "_learned_with", lambda state: ("fine", ""))
    assert "another preset" in addon.states.state_of(learned, "learn").reason
    learned.karf.preset = "fine"
    assert kinds(addon, learned)["learn"] == "done"


def test_step_of_the_running_job_is_shown(addon, learned, monkeypatch):
    request = addon.engine_api.Request("segmentation", addon.folders.project_of(learned).folder, {})
    monkeypatch.setattr(addon.runner, "current_request", lambda scene: request)
    assert kinds(addon, learned)["learn"] == "running"


@pytest.mark.parametrize(
    ("before", "after", "changes"),
    [
        ({}, NEW, dict.fromkeys(NEW, False) | {"import": True}),
        ({}, DONE | {"edit": "to do"}, dict.fromkeys(NEW, False) | {"edit": True}),
        (NEW, IMPORTED, {"import": False, "learn": True, "mark": True}),
        (IMPORTED, MARKED, {"learn": True}),  # marking stays open
        (
            MARKED,
            MARKED | {"learn": "done"},
            {"import": False, "mark": False, "learn": False, "edit": True},
        ),
        (DONE, DONE | {"learn": "stale"}, {"learn": True}),
    ],
)
def test_finished_steps_fold_and_the_next_opens(addon, before, after, changes):
    assert addon.states.opened(before, after) == changes


def test_panels_opened_by_hand_stay_until_a_step_ends(bpy, addon, project_scene, monkeypatch):
    folding = bpy.context.window_manager.karf_folding
    addon.states.update()
    assert folding.show_learn and not folding.show_import
    folding.show_import = folding.show_render = True
    addon.states.update()
    assert folding.show_import and folding.show_render
    monkeypatch.setattr(addon.states, "_is_done", lambda scene, step, known: step in ("import", "mark", "learn"))
    addon.states.update()
    assert not folding.show_import and folding.show_edit and folding.show_render
