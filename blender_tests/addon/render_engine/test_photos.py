"""A rendered 3D View shows the render engine's picture, and no photo over it."""

from types import SimpleNamespace

import pytest

from ..conftest import MODULE


@pytest.fixture
def area(bpy, learned):
    """A 3D View of the scene."""
    area = bpy.context.window_manager.windows[0].screen.areas[0]
    area.type = "VIEW_3D"
    yield area
    area.type = "VIEW_3D"
    area.spaces.active.shading.type = "SOLID"


def photos_shown(scene):
    return [camera.data.show_background_images for camera in scene.karf.rig.children if camera.karf_view]


@pytest.mark.parametrize("way_out", ["shading", "engine", "area"])
def test_photos_hide_in_the_rendered_view_and_come_back(bpy, addon, learned, area, way_out):
    hidden_by_user = addon.cameras.camera_of(learned, "photo_2").data
    hidden_by_user.show_background_images = False
    space = area.spaces.active
    addon.steps.use_engine(learned, [space])
    assert space.shading.type == "RENDERED" and photos_shown(learned) == [False] * 3
    addon.steps.look_through(learned, "photo_1")
    if way_out == "shading":
        space.shading.type = "SOLID"
    elif way_out == "engine":
        learned.render.engine = addon.compat.EEVEE
    else:
        area.type = "IMAGE_EDITOR"
    addon.render_photos.follow()
    assert photos_shown(learned) == [True, True, False]


def test_photo_that_is_straightened_later_is_still_put_behind_a_hidden_one(addon, learned, area):
    view = addon.captures.view_of(learned, "photo_1")
    addon.cameras.camera_of(learned, "photo_1").data.background_images.clear()
    addon.steps.use_engine(learned, [area.spaces.active])
    assert addon.cameras.lacks_background(learned, view)


def test_rendered_view_during_a_job_says_that_it_waits(bpy, addon, learned, area, monkeypatch):
    shown = addon.viewport.Viewport()
    with monkeypatch.context() as busy:
        busy.setattr(addon.viewport.runner, "is_running", lambda: True)
        shown._ask(bpy.context, bpy.context.view_layer.depsgraph)
    assert "waits for it" in shown.message


def test_rendered_view_says_that_its_first_picture_is_on_the_way(bpy, addon, learned, area, monkeypatch):
    context = SimpleNamespace(region=SimpleNamespace(width=60, height=30), region_data=area.spaces.active.region_3d)
    monkeypatch.setattr(addon.viewport.queries, "send", lambda *given: None)
    monkeypatch.setattr(addon.viewport, "_pinhole", lambda *given: addon.lens.pinhole(learned, learned.camera))
    shown = addon.viewport.Viewport()
    shown._ask(context, bpy.context.view_layer.depsgraph)
    assert "first picture" in shown.message


def test_extension_is_disabled_and_enabled_while_it_renders_the_view(bpy, addon, learned, area):
    addon.steps.use_engine(learned, [area.spaces.active])
    assert learned.render.engine == "KARF"
    bpy.ops.preferences.addon_disable(module=MODULE)
    shown = [each.show_background_images for each in bpy.data.cameras if each.background_images]
    bpy.ops.preferences.addon_enable(module=MODULE)
    assert shown and all(shown)
    assert learned.render.engine == "KARF"
