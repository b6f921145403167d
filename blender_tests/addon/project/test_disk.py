"""Drawing and polls never touch the disk; what they say follows it, also where the project is gone and comes back."""

import builtins
import os
import shutil
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from ..layout import Layout

DISK = [(os, name) for name in ("stat", "lstat", "scandir", "listdir", "open", "access")]
DISK += [(os.path, name) for name in ("exists", "isfile", "isdir", "getmtime")]
DISK += [(Path, name) for name in ("exists", "is_file", "is_dir", "stat", "iterdir", "glob", "open")]


@pytest.fixture
def timed(addon, monkeypatch):
    """The extension as in a window, where a timer reads the disk; the tests are this timer."""
    monkeypatch.setattr(addon.disk, "HAS_TIMER", True)
    monkeypatch.setattr(addon.preferences.state, "HAS_TIMER", True)
    addon.disk.refresh()


def context_of(bpy):
    return SimpleNamespace(
        scene=bpy.context.scene,
        window_manager=bpy.context.window_manager,
        screen=SimpleNamespace(areas=[]),
        area=SimpleNamespace(type="VIEW_3D"),
    )


def draw_all(bpy, addon):
    """The panel; returns what was drawn, and the steps that are done."""
    drawn = []
    addon.sidebar.draw_steps(Layout(bpy, drawn), context_of(bpy))
    states = {step: addon.states.state_of(bpy.context.scene, step) for step in addon.states.STEPS}
    return drawn, [step for step, state in states.items() if state.kind == addon.states.DONE]


def poll_all(bpy):
    for name in dir(bpy.ops.karf):
        getattr(bpy.ops.karf, name).poll()


def test_drawing_and_polls_never_touch_the_disk(bpy, addon, learned, timed, monkeypatch, tmp_path):
    addon.steps.show_photo(learned)
    learned.karf.masks = str(tmp_path)
    learned.karf.out = str(tmp_path / "out")
    draw_all(bpy, addon)  # makes the icons

    def touched(*arguments, **_):
        raise AssertionError(f"the disk was touched: {arguments}")

    for owner, name in [*DISK, (builtins, "open")]:
        monkeypatch.setattr(owner, name, touched)
    try:
        drawn, done = draw_all(bpy, addon)
        poll_all(bpy)
        preferences = addon.preferences.current()
        drawing = SimpleNamespace(layout=Layout(bpy, []), bl_rna=preferences.bl_rna)
        type(preferences).draw(drawing, context_of(bpy))
    finally:
        monkeypatch.undo()
    assert "Show" in drawn and "import" in done


def test_what_is_drawn_follows_jobs_masks_and_the_chosen_view(bpy, addon, timed, capture_folder, tmp_path):
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert not bpy.ops.karf.segment.poll()
    addon.steps.learn_scene(bpy.context.scene).wait()
    assert "learn" in draw_all(bpy, addon)[1]
    scene = bpy.context.scene
    addon.steps.add_object(scene, "pot")
    addon.steps.mark_stroke(scene, [(5, 5)], 3)
    assert bpy.ops.karf.segment.poll()
    addon.steps.extract_palette(scene).wait()
    assert "Show" in draw_all(bpy, addon)[0]
    scene.karf.active_view = "photo_2"
    assert "Prepare" in draw_all(bpy, addon)[0]


def test_the_timer_notices_what_others_do_to_the_disk(bpy, addon, learned, timed):
    assert not addon.disk.refresh()
    addon.folders.project_of(learned).planes_file("photo_0").unlink()
    assert addon.disk.refresh() and "Prepare" in draw_all(bpy, addon)[0]


@pytest.fixture
def many_masks(addon, learned, timed, tmp_path):
    """A folder of 500 masks of one object, some in a subfolder, which the timer has read; returns one of them."""
    (tmp_path / "masks" / "pot" / "left").mkdir(parents=True)
    masks = [tmp_path / "masks" / "pot" / place / f"{n}.png" for place in ("", "left") for n in range(250)]
    for mask in masks:
        mask.touch()
    learned.karf.masks = str(tmp_path / "masks")
    addon.disk._tick()
    return masks[-1]


def test_the_timer_walks_through_no_folder_of_masks_that_is_as_before(addon, learned, many_masks, monkeypatch):
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


@pytest.mark.parametrize("change", ["add", "remove", "overwrite"])
def test_the_timer_notices_masks_of_other_programs(addon, learned, many_masks, monkeypatch, change):
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
    assert found.masks == {"pot": {"add": 501, "remove": 499, "overwrite": 500}[change]}
    assert "segmentation" in found.outdated


def test_a_missing_project_is_named_and_nothing_waits_on_it(bpy, addon, learned, timed, tmp_path):
    project = addon.folders.project_of(learned).folder
    shutil.move(project, tmp_path / "elsewhere")
    assert addon.disk._tick() == addon.disk.REFRESH_SECONDS
    drawn, done = draw_all(bpy, addon)
    assert "The project folder is missing" in drawn and done == []
    assert str(project) in "".join(text for text in drawn if isinstance(text, str))
    for name in (
        "learn_scene",
        "extract_palette",
        "show_view",
        "render_view",
        "render_capture",
        "mark",
        "becomes",
    ):
        with pytest.raises(RuntimeError, match="is missing: bring it back"):
            getattr(bpy.ops.karf, name)()
    assert bpy.ops.karf.import_capture.poll() and bpy.ops.karf.save_edit.poll()
    shutil.move(tmp_path / "elsewhere", project)
    addon.disk._tick()
    drawn, done = draw_all(bpy, addon)
    assert "The project folder is missing" not in drawn and "learn" in done
    assert bpy.ops.karf.learn_scene.poll()


def test_importing_again_makes_a_missing_project_again(bpy, addon, learned, timed, capture_folder):
    project = addon.folders.project_of(learned).folder
    shutil.rmtree(project)
    addon.steps.import_capture(learned, capture_folder, project)
    assert bpy.ops.karf.learn_scene.poll() and not bpy.ops.karf.segment.poll()


def test_a_place_that_cannot_be_written_is_redone_and_the_cameras_come(addon, scene, capture_folder, tmp_path):
    (tmp_path / "file").touch()
    capture = addon.steps.import_capture(scene, capture_folder, tmp_path / "file" / "project")
    assert "cannot be made" in capture.warnings[-1] and len(scene.karf.rig.children) == 3


def test_reading_the_disk_never_raises(addon, learned, timed, monkeypatch):
    def refused(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(addon.disk, "is_prepared", refused)
    addon.disk._tick()
    assert addon.disk.contents_of(learned) == addon.disk.Contents()


def test_in_background_mode_every_question_reads_the_disk(bpy, addon, learned):
    """Scripts change files between two lines; no timer fires there."""
    addon.folders.project_of(learned).planes_file("photo_0").unlink()
    assert not addon.disk.contents_of(learned).is_prepared


def test_disabling_the_extension_leaves_no_timer_and_no_handler(bpy, addon):
    addon.session.start_timer(addon.disk._tick, 60, persistent=True)
    events = addon.disk._after_change.karf_events
    addon.extension.unregister()
    left = [event for event in events if addon.disk._after_change in getattr(bpy.app.handlers, event)]
    is_timed = bpy.app.timers.is_registered(addon.disk._tick)
    addon.extension.register()
    assert not left and not is_timed
    assert all(addon.disk._after_change in getattr(bpy.app.handlers, event) for event in events)
