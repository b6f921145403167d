"""Looking through a captured camera changes the scene only until it is left, and only what nobody has changed since."""

import pytest


@pytest.fixture
def shot(bpy, addon, scene, capture_folder, tmp_path):
    """A scene with a camera and a render size of its own, and a capture, looked through."""
    scene.camera = bpy.data.objects.new("Mine", bpy.data.cameras.new("Mine"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.pixel_aspect_y = 1998, 1080, 1.5
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    return scene


def picture(scene):
    return scene.camera.name, scene.render.resolution_x, scene.render.resolution_y, scene.render.pixel_aspect_y


def test_leaving_gives_the_scene_its_camera_and_picture_back(bpy, shot):
    assert picture(shot)[:3] == ("photo_0", 24, 16)
    bpy.ops.karf.look_through(view="photo_2")
    bpy.ops.karf.leave_view()
    assert picture(shot) == ("Mine", 1998, 1080, 1.5)
    assert not bpy.ops.karf.leave_view.poll()


def test_what_was_chosen_meanwhile_stays(bpy, shot):
    shot.camera, shot.render.resolution_x = bpy.data.objects["Mine"], 640
    bpy.ops.karf.leave_view()
    assert picture(shot)[:3] == ("Mine", 640, 16)


def test_the_others_hide_while_one_is_looked_through(bpy, shot):
    rig = {item.name: item for item in shot.karf.rig.children}
    rig["photo_1"].hide_set(True)
    shot.karf.looking.hides_others = True
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_0"]
    bpy.ops.karf.look_through(view="photo_2")
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_2"]
    bpy.ops.karf.leave_view()
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_0", "photo_2"]  # photo_1 was the user's wish


def test_a_camera_that_is_clicked_becomes_the_active_view(bpy, addon, shot, monkeypatch):
    layer = bpy.context.view_layer
    for name, view in (("photo_1", "photo_1"), ("Mine", "photo_1"), ("photo_2", "photo_2")):
        layer.objects.active = bpy.data.objects[name]
        addon.clicking.choose_clicked(shot, layer)
        assert shot.karf.active_view == view
    monkeypatch.setattr(addon.clicking, "_is_looking_through", lambda: True)
    layer.objects.active = bpy.data.objects["photo_1"]
    addon.clicking.choose_clicked(shot, layer)
    assert shot.karf.active_view == "photo_2"
