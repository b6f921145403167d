"""Each step says how it stands; steps that are done fold and the next opens, and what the user opened stays."""

import os

import numpy as np
import pytest

NEW = dict.fromkeys(("import", "learn", "mark", "segment", "palette", "edit", "render"), "to do")


@pytest.fixture
def masks(addon, project_scene, tmp_path):
    """The scene, learned, with a mask of the pot."""
    addon.images.write_png(tmp_path / "masks" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    project_scene.karf.masks = str(tmp_path / "masks")
    addon.steps.learn_scene(project_scene).wait()
    addon.steps.segment(project_scene).wait()
    addon.folders.project_of(project_scene).segmentation_file.touch()
    addon.steps.extract_palette(project_scene).wait()
    return tmp_path / "masks"


def kinds(addon, scene):
    return {step: addon.states.state_of(scene, step).kind for step in addon.states.STEPS}


def is_open(changes):
    return {step for step, opens in changes.items() if opens}


def test_a_step_is_done_when_what_it_makes_is_there(addon, learned):
    done = [step for step, kind in kinds(addon, learned).items() if kind == "done"]
    assert done == ["import", "learn", "palette"]


def test_a_mask_that_is_newer_than_the_segments_makes_them_stale(addon, project_scene, masks):
    assert kinds(addon, project_scene)["segment"] == "done"
    mask = masks / "pot" / "photo_0.png"
    later = mask.stat().st_mtime + 60
    os.utime(mask, (later, later))
    state = addon.states.state_of(project_scene, "segment")
    assert state.kind == "stale" and "Marks have changed" in state.reason


@pytest.mark.parametrize("mark", ["corrections/pot/photo_0.png", "volumes.json"])
def test_so_does_a_correction_or_a_volume(addon, project_scene, masks, mark):
    file = addon.folders.project_of(project_scene).folder / mark
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(b"")
    addon.disk.refresh()
    assert kinds(addon, project_scene)["segment"] == "done"
    later = file.stat().st_mtime + 60
    os.utime(file, (later, later))
    addon.disk.refresh()
    assert kinds(addon, project_scene)["segment"] == "stale"


def test_a_stage_that_ran_anew_makes_the_later_ones_stale(addon, project_scene, masks):
    addon.steps.learn_scene(project_scene).wait()
    assert kinds(addon, project_scene)["segment"] == kinds(addon, project_scene)["palette"] == "stale"
    assert "learned again" in addon.states.state_of(project_scene, "segment").reason
    assert "segmented again" in addon.states.state_of(project_scene, "palette").reason


def test_another_preset_than_was_learned_with_says_so(addon, learned, monkeypatch):
    monkeypatch.setattr(addon.disk, "_learned_with", lambda state: ("fine", ""))
    assert "another preset" in addon.states.state_of(learned, "learn").reason
    learned.karf.preset = "fine"
    assert kinds(addon, learned)["learn"] == "done"


def test_the_step_whose_job_runs_says_so(addon, learned, monkeypatch):
    project = addon.folders.project_of(learned).folder
    request = addon.engine_api.Request("segmentation", project, {})
    monkeypatch.setattr(addon.runner, "current_request", lambda scene: request)
    assert kinds(addon, learned)["segment"] == "running"


def test_an_empty_file_opens_the_import_and_a_learned_one_the_edit(addon):
    opened = addon.states.opened
    assert is_open(opened({}, NEW)) == {"import"}
    assert is_open(opened({}, dict.fromkeys(NEW, "done") | {"edit": "to do"})) == {"edit"}


def test_a_step_that_is_done_folds_and_the_next_opens(addon):
    imported = NEW | {"import": "done"}
    assert addon.states.opened(NEW, imported) == {"import": False, "learn": True, "mark": True}
    learned = imported | {"learn": "done", "mark": "done"}
    changes = addon.states.opened(imported | {"mark": "done"}, learned)
    assert changes == {"import": False, "learn": False, "segment": True}


def test_marking_stays_open_until_the_step_behind_it_is_done(addon):
    before = NEW | {"import": "done", "learn": "done"}
    assert addon.states.opened(before, before | {"mark": "done"}) == {"segment": True}
    assert addon.states.opened(before, before | {"mark": "done", "segment": "done"})["mark"] is False


def test_a_step_that_becomes_stale_opens(addon):
    done = dict.fromkeys(NEW, "done")
    assert addon.states.opened(done, done | {"segment": "stale"}) == {"segment": True}


def test_what_is_opened_by_hand_stays_until_a_step_is_done(bpy, addon, project_scene):
    folding = bpy.context.window_manager.karf_folding
    addon.states.update()
    assert folding.show_learn and not folding.show_import
    folding.show_import = folding.show_render = True
    addon.states.update()
    assert folding.show_import and folding.show_render
    addon.steps.learn_scene(project_scene).wait()
    addon.states.update()
    assert not folding.show_import and folding.show_render
