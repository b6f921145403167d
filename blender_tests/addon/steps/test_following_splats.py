"""An object of splats has the colors of the swatches, whatever changes these; the fake engine makes the colors."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from ..surface.splat_objects import KINDS, N, colors_of, make
from ..timers import pretend_window


@pytest.fixture
def scene_of_splats(addon, learned):
    addon.steps.learn_splats(learned).wait()
    return learned


@pytest.fixture
def beside(bpy, addon, scene_of_splats, monkeypatch):
    """The scene as beside the interface. `settle()` is Blender's timer, until nothing is to be done any more."""
    pretend_window(bpy, monkeypatch, addon.splats, addon.queries, addon.session)
    asked = []
    send = addon.queries.send
    monkeypatch.setattr(addon.queries, "send", lambda *arguments: (asked.append(arguments[2]), send(*arguments)))

    def settle():
        deadline, before = time.monotonic() + 20, len(asked)
        addon.splats._tick()
        while addon.queries.is_waiting("harmonics"):
            assert time.monotonic() < deadline
            addon.queries._poll()
            addon.splats._tick()
            time.sleep(0.01)
        return asked[before:]

    yield SimpleNamespace(settle=settle, asked=asked, karf=scene_of_splats.karf)


def set_pot(bpy, addon, color):
    addon.steps.set_swatch(bpy.context.scene, "pot", 1, color)


def assert_shows(item, color):
    """The fake engine's harmonics: the pot's swatch, and others that count the points."""
    found = colors_of(item)[0]
    np.testing.assert_allclose(found[:, 0], np.broadcast_to(color, (N, 3)), atol=1e-6)
    expected = np.arange(N)[:, None, None] + np.float32([[[0.1], [0.2], [0.3]]])
    np.testing.assert_allclose(found[:, 1:], np.broadcast_to(expected, (N, 3, 3)), atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_script_gives_an_object_the_colors_of_now(bpy, addon, scene_of_splats, kind):
    item = make(bpy, kind, 4)
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    addon.steps.follow_splat(scene_of_splats, item)
    assert_shows(item, (0.1, 0.2, 0.9))
    set_pot(bpy, addon, (0.9, 0.2, 0.1))
    addon.steps.follow_splat(scene_of_splats, item)
    assert_shows(item, (0.9, 0.2, 0.1))


def test_it_follows_swatches_and_asks_no_more_than_they_change(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    assert beside.settle() == []  # the first colors were already on their way
    assert_shows(item, (0.8, 0.2, 0.1))
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    assert len(beside.settle()) == 1
    assert_shows(item, (0.1, 0.2, 0.9))
    assert beside.settle() == []


def test_of_several_changes_the_newest_wins(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    for blue in (0.3, 0.5, 0.7):
        set_pot(bpy, addon, (0.1, 0.2, blue))
        addon.splats._tick()
    assert len(beside.asked) == 1
    assert len(beside.settle()) == 1
    assert_shows(item, (0.1, 0.2, 0.7))


def test_the_engine_hears_of_the_objects_points(bpy, addon, beside):
    addon.steps.follow_splat(bpy.context.scene, make(bpy, "kiri", 4))
    (options,) = beside.asked
    assert options["points"]["count"] == N and options["points"]["positions"][2] == [2, 4, -2]
    beside.settle()


def test_an_object_that_follows_no_more_keeps_its_colors(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    beside.settle()
    addon.steps.unfollow_splat(bpy.context.scene)
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    assert beside.settle() == [] and addon.splats._tick() is None
    assert_shows(item, (0.8, 0.2, 0.1))


def test_colors_that_come_too_late_are_dropped(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    before = colors_of(item)[0]
    addon.steps.follow_splat(bpy.context.scene, item)
    addon.steps.unfollow_splat(bpy.context.scene)
    beside.settle()
    np.testing.assert_array_equal(colors_of(item)[0], before)


def test_undo_of_a_swatch_brings_its_colors_back(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    beside.settle()
    bpy.ops.ed.undo_push(message="as learned")
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    bpy.ops.ed.undo_push(message="blue")  # before the colors come: the step has the old ones
    beside.settle()
    bpy.ops.ed.undo()
    beside.settle()
    assert_shows(bpy.data.objects["splats"], (0.8, 0.2, 0.1))
    bpy.ops.ed.redo()
    beside.settle()
    assert_shows(bpy.data.objects["splats"], (0.1, 0.2, 0.9))


def test_a_deleted_object_is_asked_for_no_more_and_undo_brings_it_back(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    beside.settle()
    bpy.context.scene.collection.objects.unlink(item)
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    assert beside.settle() == []
    bpy.context.scene.collection.objects.link(item)
    assert len(beside.settle()) == 1
    assert_shows(item, (0.1, 0.2, 0.9))
    bpy.data.objects.remove(item)
    assert beside.settle() == [] and addon.splats._tick() is None


def test_in_edit_mode_it_waits(bpy, addon, beside):
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    bpy.ops.object.mode_set(mode="EDIT")
    assert beside.settle() == []
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(beside.settle()) == 1
    assert_shows(item, (0.8, 0.2, 0.1))


def test_a_scene_without_its_project_asks_nothing(bpy, addon, beside):
    addon.steps.follow_splat(bpy.context.scene, make(bpy, "kiri", 4))
    beside.settle()
    beside.karf.project = ""
    assert beside.settle() == []


def test_what_a_task_learns_is_asked_for(bpy, addon, beside, monkeypatch):
    addon.steps.follow_splat(bpy.context.scene, make(bpy, "kiri", 4))
    beside.settle()
    with monkeypatch.context() as patch:
        patch.setattr(addon.runner, "is_running", lambda: True)
        assert beside.settle() == []
    assert len(beside.settle()) == 1


def test_a_refusal_is_said_once_and_the_next_change_is_asked_for(bpy, addon, beside, monkeypatch):
    item = make(bpy, "kiri", 4)
    points_of = addon.splat_objects.points_of
    monkeypatch.setattr(addon.splat_objects, "points_of", lambda item: points_of(item) | {"count": 3})
    addon.steps.follow_splat(bpy.context.scene, item)
    assert beside.settle() == []
    assert f"has {N} points, but there are colors for 3 splats" in addon.progress.state().error
    monkeypatch.setattr(addon.splat_objects, "points_of", points_of)
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    beside.settle()
    assert_shows(item, (0.1, 0.2, 0.9))


def test_an_engine_that_cannot_start_is_said(bpy, addon, beside, monkeypatch):
    addon.steps.follow_splat(bpy.context.scene, make(bpy, "kiri", 4))
    beside.settle()

    def refuse(*_):
        raise addon.engine_api.BadRequest("There is no engine yet.")

    monkeypatch.setattr(addon.queries, "send", refuse)
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    assert addon.splats._tick() is not None
    assert addon.progress.state().error == "There is no engine yet."


def test_a_saved_object_goes_on_following_and_starts_no_engine_before_a_change(bpy, addon, beside, tmp_path):
    addon.steps.follow_splat(bpy.context.scene, make(bpy, "kiri", 4))
    beside.settle()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert beside.settle() == []
    set_pot(bpy, addon, (0.1, 0.2, 0.9))
    assert len(beside.settle()) == 1
    assert_shows(bpy.context.scene.karf.surface.splat, (0.1, 0.2, 0.9))


@pytest.mark.parametrize("kind", KINDS)
def test_the_button_switches_it_on_and_off(bpy, addon, scene_of_splats, kind):
    surface = scene_of_splats.karf.surface
    item = make(bpy, kind, 4)
    assert bpy.ops.karf.follow_splat() == {"FINISHED"} and surface.splat == item
    assert_shows(item, (0.8, 0.2, 0.1))
    assert bpy.ops.karf.follow_splat() == {"FINISHED"} and surface.splat is None


def test_the_button_takes_another_object_and_lets_go_of_one_that_is_not_active(bpy, scene_of_splats):
    surface = scene_of_splats.karf.surface
    make(bpy, "kiri", 4)
    bpy.ops.karf.follow_splat()
    other = make(bpy, "kiri", 1)
    bpy.ops.karf.follow_splat()
    assert surface.splat == other
    bpy.context.view_layer.objects.active = scene_of_splats.karf.rig
    bpy.ops.karf.follow_splat()
    assert surface.splat is None and not bpy.ops.karf.follow_splat.poll()


def test_the_button_needs_splats_and_palettes(bpy, addon, learned):
    make(bpy, "kiri", 4)
    assert not bpy.ops.karf.follow_splat.poll()
    addon.steps.learn_splats(learned).wait()
    assert bpy.ops.karf.follow_splat.poll()


def test_other_objects_are_refused(bpy, addon, scene_of_splats):
    with pytest.raises(addon.steps.KarfError, match="is not a splat object"):
        addon.steps.follow_splat(scene_of_splats, scene_of_splats.karf.rig)
    item = make(bpy, "kiri", 4)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(addon.steps.KarfError, match="is in Edit Mode"):
        addon.steps.follow_splat(scene_of_splats, item)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert scene_of_splats.karf.surface.splat is None


def test_in_background_mode_no_timer_is_left_after_a_file_is_opened(bpy, addon, learned, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert not bpy.app.timers.is_registered(addon.splats._tick)
