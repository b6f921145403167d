"""Panels follow the project's files without reading the disk; fingerprints tell what is current."""

import builtins
import json
import os
import shutil
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from karf_engine.palettes.compositing import write_planes

from ..layout import Layout, drawn_preferences
from ..prepared import write_current_planes

DISK = [(os, name) for name in ("stat", "lstat", "scandir", "listdir", "open", "access")]
DISK += [(os.path, name) for name in ("exists", "isfile", "isdir", "getmtime")]
DISK += [(Path, name) for name in ("exists", "is_file", "is_dir", "stat", "iterdir", "glob", "open")]
LATER, EARLIER = 4e9, 1e9


@pytest.fixture
def timed(addon, monkeypatch):
    """Make the extension read the disk only by its timer, as in a window; the tests call the timer."""
    monkeypatch.setattr(addon.disk, "HAS_TIMER", True)
    monkeypatch.setattr(addon.preferences.state, "HAS_TIMER", True)
    addon.disk.refresh()


def draw_all(bpy, addon):
    """Draw the panel; returns the drawn items and the finished steps."""
    drawn, scene = [], bpy.context.scene
    window = {"window_manager": bpy.context.window_manager, "screen": SimpleNamespace(areas=[])}
    context = SimpleNamespace(scene=scene, area=SimpleNamespace(type="VIEW_3D"), **window)
    addon.sidebar.draw_steps(Layout(bpy, drawn), context)
    states = {step: addon.states.state_of(scene, step) for step in addon.states.STEPS}
    return drawn, [step for step, state in states.items() if state.kind == addon.states.DONE]


def test_drawing_and_polls_never_touch_the_disk(bpy, addon, learned, timed, monkeypatch, tmp_path):
    addon.steps.show_photo(learned)
    learned.karf.masks = str(tmp_path)
    learned.karf.out = str(tmp_path / "out")
    draw_all(bpy, addon)  # loads the icons

    def fail(*arguments, **_):
        raise AssertionError(f"the disk was touched: {arguments}")

    for owner, name in [*DISK, (builtins, "open")]:
        monkeypatch.setattr(owner, name, fail)
    try:
        drawn, done = draw_all(bpy, addon)
        for name in dir(bpy.ops.karf):
            getattr(bpy.ops.karf, name).poll()
        drawn_preferences(bpy, addon.preferences.current())
    finally:
        monkeypatch.undo()
    assert "Show" in drawn and "import" in done


def test_panel_follows_jobs_masks_and_the_active_view(bpy, addon, project_scene, timed):
    assert not bpy.ops.karf.segment.poll()
    addon.steps.learn_scene(project_scene).wait()
    addon.steps.add_object(project_scene, "pot")
    addon.steps.mark_stroke(project_scene, [(5, 5)], 3)
    assert bpy.ops.karf.segment.poll()
    addon.steps.extract_palette(project_scene).wait()
    drawn, done = draw_all(bpy, addon)
    assert "Show" in drawn and {"mark", "learn"} <= {*done}
    project_scene.karf.active_view = "photo_2"
    assert "Prepare" in draw_all(bpy, addon)[0]


def test_timer_notices_changes_by_other_programs(bpy, addon, learned, timed):
    assert not addon.disk.refresh()
    addon.folders.project_of(learned).planes_file("photo_0").unlink()
    assert addon.disk.refresh() and "Prepare" in draw_all(bpy, addon)[0]


def test_disk_is_read_at_each_call_in_background_mode(addon, learned):
    addon.folders.project_of(learned).planes_file("photo_0").unlink()
    assert not addon.disk.contents_of(learned).is_prepared


def test_reading_the_disk_never_raises(addon, learned, timed, monkeypatch):
    def fail(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(addon.disk, "is_prepared", fail)
    addon.disk._tick()
    assert addon.disk.contents_of(learned) == addon.disk.Contents()


@pytest.fixture
def many_masks(addon, learned, timed, tmp_path):
    """500 masks of one object, half of them in a subfolder, known to the timer; returns one of them."""
    (tmp_path / "masks" / "pot" / "left").mkdir(parents=True)
    masks = [tmp_path / "masks" / "pot" / place / f"{n}.png" for place in ("", "left") for n in range(250)]
    for mask in masks:
        mask.touch()
    learned.karf.masks = str(tmp_path / "masks")
    addon.disk._tick()
    return masks[-1]


def test_timer_does_not_list_unchanged_mask_folders(addon, learned, many_masks, monkeypatch):
    calls = []

    def counted(function):
        return lambda *arguments, **options: (calls.append(arguments), function(*arguments, **options))[1]

    monkeypatch.setattr(addon.disk.time, "monotonic", lambda: 1e6)
    for owner, name in DISK[:6]:
        monkeypatch.setattr(owner, name, counted(getattr(owner, name)))
    addon.disk.refresh()
    calls.clear()
    addon.disk._tick()
    assert 0 < len(calls) < 60 and addon.disk.contents_of(learned).masks == {"pot": 500}


@pytest.mark.parametrize("change, count", [("add", 501), ("remove", 499), ("overwrite", 500)])
def test_timer_notices_changed_masks(addon, learned, many_masks, monkeypatch, change, count):
    project, later = addon.folders.project_of(learned), time.time() + 60
    project.finish("segmentation", "s")
    project.segmentation_file.touch()
    addon.disk._tick()
    assert "segmentation" not in addon.disk.contents_of(learned).outdated
    if change == "overwrite":
        os.utime(many_masks, (later, later))
        monkeypatch.setattr(addon.disk.time, "monotonic", lambda: 1e9)  # a while later
    else:
        many_masks.with_name("more.png").touch() if change == "add" else many_masks.unlink()
        os.utime(many_masks.parent, (later, later))
    addon.disk._tick()
    found = addon.disk.contents_of(learned)
    assert found.masks == {"pot": count} and "segmentation" in found.outdated


def test_missing_project_is_named_until_it_is_back(bpy, addon, learned, timed, tmp_path):
    project = addon.folders.project_of(learned).folder
    shutil.move(project, tmp_path / "elsewhere")
    assert addon.disk._tick() == addon.disk.REFRESH_SECONDS
    drawn, done = draw_all(bpy, addon)
    assert "The project folder is missing" in drawn and done == []
    assert str(project) in "".join(text for text in drawn if isinstance(text, str))
    steps = "learn_scene extract_palette show_view render_view render_capture mark becomes"
    for name in steps.split():
        with pytest.raises(RuntimeError, match="is missing: bring it back"):
            getattr(bpy.ops.karf, name)()
    assert bpy.ops.karf.import_capture.poll() and bpy.ops.karf.save_edit.poll()
    shutil.move(tmp_path / "elsewhere", project)
    addon.disk._tick()
    drawn, done = draw_all(bpy, addon)
    assert "The project folder is missing" not in drawn and "learn" in done
    assert bpy.ops.karf.learn_scene.poll()


def test_importing_again_restores_a_missing_project(bpy, addon, learned, timed, capture_folder):
    project = addon.folders.project_of(learned).folder
    shutil.rmtree(project)
    addon.steps.import_capture(learned, capture_folder, project)
    assert bpy.ops.karf.learn_scene.poll() and not bpy.ops.karf.segment.poll()


def test_cameras_are_imported_without_a_writable_project(addon, scene, capture_folder, tmp_path):
    (tmp_path / "file").touch()
    capture = addon.steps.import_capture(scene, capture_folder, tmp_path / "file" / "project")
    assert "cannot be made" in capture.warnings[-1] and len(scene.karf.rig.children) == 3


POT, MUG = {"share": 0.25, "unseen": 0.9}, {"share": 0, "unseen": 0}


@pytest.mark.parametrize(
    ("report", "expected"),
    [
        ({"suggestions": {"photo_2": 0.2, "gone": 0.1, "photo_0": 0.1}}, {"suggested": ("photo_2", "photo_0")}),
        ({"suggestions": 3}, {}),
        ({"any_view_helps": True}, {"any_view_helps": True}),
        *(({"any_view_helps": value}, {}) for value in (False, 3, "yes")),
        ({"unsure": {"pot": POT, "mug": MUG}}, {"unsure": (("pot", 0.25, True), ("mug", 0.0, False))}),
        *(({"unsure": value}, {}) for value in (3, {"pot": 1}, {"pot": {"share": "x"}})),
        ({}, {}),
        ([], {}),
    ],
)
def test_segmentation_report_gives_suggestions_and_doubts(addon, project_scene, report, expected):
    project = addon.folders.project_of(project_scene)
    project.create("capture")
    project.finish("geometry", "g")
    project.finish("segmentation", "s")
    project.segmentation_report.write_text(json.dumps(report))
    found = addon.disk.read(project_scene)
    assert found.suggested == expected.get("suggested", ()) and found.unsure == expected.get("unsure", ())
    assert found.any_view_helps is expected.get("any_view_helps", False)


def set_times(folder, seconds):
    """Give all files of a project the same time."""
    for path in folder.rglob("*"):
        os.utime(path, (seconds, seconds))


@pytest.mark.parametrize("seconds", [LATER, EARLIER])
def test_planes_are_current_until_a_stage_reruns(addon, learned, seconds):
    project = addon.folders.project_of(learned)
    set_times(project.folder, seconds)
    assert addon.disk.is_prepared(learned)
    project.finish("recoloring", "fake", files={"recoloring.safetensors": "of another run"})
    os.utime(project.recoloring_file, (EARLIER, EARLIER))
    assert not addon.disk.is_prepared(learned)
    with pytest.raises(addon.engine_api.DataError, match="was made from other palettes"):
        addon.displayed.of(learned).prepared_view()


def test_planes_without_fingerprint_or_damaged_are_not_current(addon, learned):
    file = addon.disk.planes_file(learned)
    planes = addon.engine_api.read_planes(file)
    write_planes(file, planes)
    assert not addon.disk.is_prepared(learned)
    write_current_planes(addon, learned, planes)
    assert addon.disk.is_prepared(learned)
    file.write_bytes(file.read_bytes()[:-100])
    assert not addon.disk.is_prepared(learned)


@pytest.mark.parametrize("stage", ["geometry", "segmentation"])
def test_renderings_and_masks_are_current_until_a_stage_reruns(bpy, addon, learned, stage):
    project = addon.folders.project_of(learned)
    project.uncertainty_file.touch()
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    set_times(project.folder, EARLIER)
    finders = addon.disk.rendering_of, addon.disk.rendered_masks, addon.disk.rendered_doubts
    assert all(find(learned) for find in finders)
    set_times(project.folder / "seen", LATER)
    project.finish(stage, "anew")
    assert not any(find(learned) for find in finders)


def test_only_outdated_renderings_are_removed(bpy, addon, learned, tmp_path):
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    before = addon.disk.renderings_folder(learned)
    others = [before.with_name("notes"), before.with_name("0123456789abcdef")]
    (tmp_path / "films").mkdir()
    others[0].mkdir()
    others[1].symlink_to(tmp_path / "films", target_is_directory=True)
    addon.folders.project_of(learned).finish("segmentation", "anew")
    assert bpy.ops.karf.see_view() == {"FINISHED"}
    own = addon.disk.renderings_folder(learned)
    assert own != before and set(before.parent.iterdir()) == {own, *others} and (tmp_path / "films").is_dir()
