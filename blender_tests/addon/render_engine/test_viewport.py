"""A rendered 3D View requests small pictures during changes and the full one at rest."""

from types import SimpleNamespace

import numpy as np
import pytest

WIDTH, HEIGHT = 600, 300


@pytest.fixture
def view(bpy, addon, learned, monkeypatch):
    """A 3D View: `draw()` redraws it after some seconds, `long_sides` are the sizes requested."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(addon.viewport.time, "monotonic", lambda: clock.now)
    monkeypatch.setattr(addon.session, "start_timer", lambda poll: None)
    camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    depsgraph = bpy.context.view_layer.depsgraph
    data = SimpleNamespace(
        is_perspective=True,
        view_matrix=camera.matrix_world.inverted(),
        window_matrix=camera.calc_matrix_camera(depsgraph, x=WIDTH, y=HEIGHT),
    )
    context = SimpleNamespace(region=SimpleNamespace(width=WIDTH, height=HEIGHT), region_data=data)
    shown, long_sides = addon.viewport.Viewport(), []
    send = addon.queries.send

    def record(scene, kind, options, *rest):
        long_sides.append(max(options["camera"]["w"], options["camera"]["h"]))
        send(scene, kind, options, *rest)

    monkeypatch.setattr(addon.viewport.queries, "send", record)

    def draw(seconds=0.0):
        clock.now += seconds
        shown._ask(context, depsgraph)
        return shown

    return SimpleNamespace(draw=draw, long_sides=long_sides, data=data, scene=learned, context=context)


def test_small_picture_precedes_the_full_one_at_rest(addon, view):
    view.draw()
    assert view.long_sides == [addon.viewport.FIRST_SIDE]
    view.draw(0.01)
    assert len(view.long_sides) == 1
    shown = view.draw(1.0)
    assert view.long_sides[1:] == [WIDTH] and shown._pixels.shape == (HEIGHT, WIDTH, 4)
    view.draw(1.0)
    assert len(view.long_sides) == 2


def test_picture_follows_swatches_and_view_and_grows_if_fast(bpy, addon, view):
    view.draw()  # the fake engine reports 10 ms
    addon.steps.set_swatch(bpy.context.scene, "pot", 1, (0.2, 0.4, 0.8))
    upper_left = view.draw(0.01)._pixels[-1, 0, :3]  # scene-linear
    np.testing.assert_allclose(upper_left, addon.engine_api.srgb_to_linear([0.2, 0.4, 0.8]), atol=2e-3)
    view.data.view_matrix = view.data.view_matrix.copy()
    view.data.view_matrix.translation.x += 1
    view.draw(0.01)
    first = addon.viewport.FIRST_SIDE
    assert len(view.long_sides) == 3 and view.long_sides[:2] == [first, 2 * first]


def test_finished_task_is_shown_also_where_nothing_was_drawn_meanwhile(addon, view):
    view.draw()
    view.draw(1.0)
    view.draw(1.0)
    assert len(view.long_sides) == 2
    addon.steps.learn_splats(view.scene).wait()
    view.draw(0.01)
    view.draw(1.0)
    assert len(view.long_sides) == 4 and view.long_sides[-1] == WIDTH


def test_orthographic_view_shows_only_a_message(bpy, addon, view, monkeypatch):
    redrawn = []
    shown = view.draw()
    monkeypatch.setattr(addon.viewport.windows, "redraw", lambda *kinds: redrawn.append(kinds))
    view.data.is_perspective = False
    shown.draw(None, view.context, bpy.context.view_layer.depsgraph)
    assert "orthographic" in shown.message and shown._pixels is None
    assert not redrawn  # which would redraw it for ever


def test_failed_query_is_repeated_only_after_a_change(addon, view, monkeypatch):
    of, behave = addon.camera_pixels.options_of, {"behave": "refuse"}
    monkeypatch.setattr(addon.camera_pixels, "options_of", lambda *given: of(*given) | behave)
    assert "photo_7.png is missing" in view.draw().message
    view.draw(1.0)
    assert len(view.long_sides) == 1
    behave["behave"] = ""
    assert view.draw(1.0).message == ""
