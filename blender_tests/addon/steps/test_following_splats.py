"""A splat object follows the swatches' colors, which the fake engine computes."""

import time
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from ..surface.splat_objects import KINDS, N, colors_of, make
from ..timers import pretend_window

LEARNED, BLUE, RED = (0.8, 0.2, 0.1), (0.1, 0.2, 0.9), (0.9, 0.2, 0.1)


@pytest.fixture
def live(bpy, addon, with_splats, monkeypatch):
    """The scene with an interface; `settle()` runs the timer until it is idle and counts engine queries."""
    pretend_window(bpy, monkeypatch, addon.splats, addon.queries, addon.session)
    asked, send = [], addon.queries.send
    monkeypatch.setattr(addon.queries, "send", lambda *arguments: (asked.append(arguments[2]), send(*arguments)))

    def settle():
        deadline, before = time.monotonic() + 20, len(asked)
        addon.splats._tick()
        while addon.queries.is_waiting("harmonics"):
            assert time.monotonic() < deadline
            addon.queries._poll()
            addon.splats._tick()
            time.sleep(0.01)
        return len(asked) - before

    return SimpleNamespace(settle=settle, asked=asked, karf=with_splats.karf)


@pytest.fixture
def item(bpy, addon, live):
    """A following object that waits for its first colors."""
    item = make(bpy, "kiri", 4)
    addon.steps.follow_splat(bpy.context.scene, item)
    return item


@pytest.fixture
def followed(live, item):
    """A following object with its first colors."""
    assert live.settle() == 0  # already requested
    return item


@pytest.fixture
def set_pot(bpy, addon):
    return lambda color: addon.steps.set_swatch(bpy.context.scene, "pot", 1, color)


def assert_shows(item, color):
    """The object has the fake engine's harmonics: the pot's swatch first, then numbers that count the points."""
    found = colors_of(item)[0]
    np.testing.assert_allclose(found[:, 0], np.broadcast_to(color, (N, 3)), atol=1e-6)
    expected = np.arange(N)[:, None, None] + np.float32([[[0.1], [0.2], [0.3]]])
    np.testing.assert_allclose(found[:, 1:], np.broadcast_to(expected, (N, 3, 3)), atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_script_and_button_apply_the_current_colors(bpy, addon, with_splats, kind, set_pot):
    item, surface = make(bpy, kind, 4), with_splats.karf.surface
    for color in (BLUE, RED):
        set_pot(color)
        addon.steps.follow_splat(with_splats, item)
        assert_shows(item, color)
    assert bpy.ops.karf.follow_splat() == {"FINISHED"} and surface.splat is None
    set_pot(BLUE)
    assert bpy.ops.karf.follow_splat() == {"FINISHED"} and surface.splat == item
    assert_shows(item, BLUE)


def test_splats_follow_each_change_once_until_released(bpy, addon, live, followed, set_pot):
    (options,) = live.asked
    assert options["points"]["count"] == N and options["points"]["positions"][2] == [2, 4, -2]
    assert_shows(followed, LEARNED)
    set_pot(BLUE)
    assert live.settle() == 1
    assert_shows(followed, BLUE)
    assert live.settle() == 0
    addon.steps.unfollow_splat(bpy.context.scene)
    set_pot(RED)
    assert live.settle() == 0 and addon.splats._tick() is None
    assert_shows(followed, BLUE)


def test_newest_of_several_changes_wins(addon, live, item, set_pot):
    for blue in (0.3, 0.5, 0.7):
        set_pot((0.1, 0.2, blue))
        addon.splats._tick()
    assert len(live.asked) == 1 and live.settle() == 1
    assert_shows(item, (0.1, 0.2, 0.7))


def test_late_colors_are_dropped(bpy, addon, live, item):
    before = colors_of(item)[0]
    addon.steps.unfollow_splat(bpy.context.scene)
    live.settle()
    np.testing.assert_array_equal(colors_of(item)[0], before)


def test_undo_and_redo_restore_splat_colors(bpy, live, followed, set_pot):
    bpy.ops.ed.undo_push(message="as learned")
    set_pot(BLUE)
    bpy.ops.ed.undo_push(message="blue")  # pushed with the old colors, before the new ones arrive
    live.settle()
    for step, color in ((bpy.ops.ed.undo, LEARNED), (bpy.ops.ed.redo, BLUE)):
        step()
        live.settle()
        assert_shows(bpy.data.objects["splats"], color)


def test_deleted_object_is_skipped_until_it_returns(bpy, addon, live, followed, set_pot):
    bpy.context.scene.collection.objects.unlink(followed)
    set_pot(BLUE)
    assert live.settle() == 0
    bpy.context.scene.collection.objects.link(followed)
    assert live.settle() == 1
    assert_shows(followed, BLUE)
    bpy.data.objects.remove(followed)
    assert live.settle() == 0 and addon.splats._tick() is None


def test_updates_wait_for_edit_mode_tasks_and_a_project(bpy, addon, live, item, monkeypatch):
    bpy.ops.object.mode_set(mode="EDIT")
    assert live.settle() == 0
    bpy.ops.object.mode_set(mode="OBJECT")
    assert live.settle() == 1
    assert_shows(item, LEARNED)
    with monkeypatch.context() as patch:
        patch.setattr(addon.runner, "is_running", lambda: True)
        assert live.settle() == 0
    assert live.settle() == 1  # the task may have changed the project
    live.karf.project = ""
    assert live.settle() == 0


def test_errors_are_reported_and_the_next_change_is_sent(bpy, addon, live, set_pot, monkeypatch):
    item, points_of = make(bpy, "kiri", 4), addon.splat_objects.points_of
    monkeypatch.setattr(addon.splat_objects, "points_of", lambda item: points_of(item) | {"count": 3})
    addon.steps.follow_splat(bpy.context.scene, item)
    assert live.settle() == 0
    assert f"has {N} points, but there are colors for 3 splats" in addon.progress.state().error
    monkeypatch.setattr(addon.splat_objects, "points_of", points_of)
    set_pot(BLUE)
    live.settle()
    assert_shows(item, BLUE)
    no_engine = addon.engine_api.BadRequest("There is no engine yet.")
    monkeypatch.setattr(addon.queries, "send", Mock(side_effect=no_engine))
    set_pot(RED)
    assert addon.splats._tick() is not None
    assert addon.progress.state().error == "There is no engine yet."


def test_saved_object_keeps_following_without_starting_the_engine(live, followed, set_pot, reopen):
    scene = reopen()
    assert live.settle() == 0
    set_pot(BLUE)
    assert live.settle() == 1
    assert_shows(scene.karf.surface.splat, BLUE)


def test_background_mode_leaves_no_timer_after_opening_a_file(bpy, addon, learned, reopen):
    reopen()
    assert not bpy.app.timers.is_registered(addon.splats._tick)


def test_button_needs_splats_and_switches_or_releases_objects(bpy, addon, learned):
    surface = learned.karf.surface
    make(bpy, "kiri", 4)
    assert not bpy.ops.karf.follow_splat.poll()
    addon.steps.learn_splats(learned).wait()
    bpy.ops.karf.follow_splat()
    other = make(bpy, "kiri", 1)
    bpy.ops.karf.follow_splat()
    assert surface.splat == other
    bpy.context.view_layer.objects.active = learned.karf.rig
    bpy.ops.karf.follow_splat()
    assert surface.splat is None and not bpy.ops.karf.follow_splat.poll()


def test_other_objects_are_rejected(bpy, addon, with_splats):
    with pytest.raises(addon.steps.KarfError, match="is not a splat object"):
        addon.steps.follow_splat(with_splats, with_splats.karf.rig)
    item = make(bpy, "kiri", 4)
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(addon.steps.KarfError, match="is in Edit Mode"):
        addon.steps.follow_splat(with_splats, item)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert with_splats.karf.surface.splat is None
