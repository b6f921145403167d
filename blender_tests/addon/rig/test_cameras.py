"""Looking through captured cameras, and how a capture is turned and scaled into Blender's world."""

from types import SimpleNamespace

import numpy as np
import pytest

TILTED = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float) @ np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])


@pytest.fixture
def shot(bpy, addon, scene, capture_folder, tmp_path):
    """A scene with its own camera and render size that looks through a captured camera."""
    scene.camera = bpy.data.objects.new("Mine", bpy.data.cameras.new("Mine"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.pixel_aspect_y = 1998, 1080, 1.5
    addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    return scene


def camera_and_size(scene):
    return scene.camera.name, scene.render.resolution_x, scene.render.resolution_y, scene.render.pixel_aspect_y


def test_leaving_restores_camera_and_render_size(bpy, shot):
    assert camera_and_size(shot)[:3] == ("photo_0", 24, 16)
    bpy.ops.karf.look_through(view="photo_2")
    bpy.ops.karf.leave_view()
    assert camera_and_size(shot) == ("Mine", 1998, 1080, 1.5)
    assert not bpy.ops.karf.leave_view.poll()


def test_settings_changed_meanwhile_stay(bpy, shot):
    shot.camera, shot.render.resolution_x = bpy.data.objects["Mine"], 640
    bpy.ops.karf.leave_view()
    assert camera_and_size(shot)[:3] == ("Mine", 640, 16)


def test_other_cameras_hide_while_looking_through_one(bpy, shot):
    rig = {item.name: item for item in shot.karf.rig.children}
    rig["photo_1"].hide_set(True)
    shot.karf.looking.hides_others = True
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_0"]
    bpy.ops.karf.look_through(view="photo_2")
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_2"]
    bpy.ops.karf.leave_view()
    assert [name for name in rig if not rig[name].hide_get()] == ["photo_0", "photo_2"]  # the user had hidden photo_1


def test_clicked_camera_becomes_the_active_view(bpy, addon, shot, monkeypatch):
    layer = bpy.context.view_layer
    for name, view in (("photo_1", "photo_1"), ("Mine", "photo_1"), ("photo_2", "photo_2")):
        layer.objects.active = bpy.data.objects[name]
        addon.following.choose_clicked(shot, layer)
        assert shot.karf.active_view == view
    monkeypatch.setattr(addon.following, "_is_looking_through", lambda: True)
    layer.objects.active = bpy.data.objects["photo_1"]
    addon.following.choose_clicked(shot, layer)
    assert shot.karf.active_view == "photo_2"


def pose_of(position, target, up):
    """The pose of a level camera that looks at a target."""
    pose = np.eye(4)
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], -1)
    pose[:3, 3] = position
    return pose


def capture_of(poses, format_name="colmap", splats=None):
    cameras = (SimpleNamespace(camera_to_world=pose, position=pose[:3, 3]) for pose in poses)
    views = [SimpleNamespace(camera=camera) for camera in cameras]
    return SimpleNamespace(format=format_name, views=views, splats=splats)


def arc(degrees, world):
    """Poses on an arc, all tilted down, in a world turned by the rotation `world`."""
    angles = np.radians(np.linspace(0, degrees, 20))
    level = np.stack([3 * np.cos(angles), 3 * np.sin(angles), np.full(20, 2.0)], -1)
    return [pose_of(world @ place, np.zeros(3), world @ (0, 0, 1)) for place in level]


@pytest.mark.parametrize("world", [np.eye(3), TILTED, np.diag([1.0, -1.0, -1.0])])
def test_up_is_found_from_photos_taken_from_above(addon, world):
    for degrees in (70, 360):
        up = addon.cameras.up_of(capture_of(arc(degrees, world)))
        assert np.degrees(np.arccos(up @ world @ (0, 0, 1))) < 4


def test_photos_side_by_side_keep_the_cameras_up(addon):
    up = np.array([0.0, -1.0, 0.0])
    poses = [pose_of(np.array([x, y, 0.0]), np.array([x, y, 9.0]), up) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    np.testing.assert_allclose(addon.cameras.up_of(capture_of(poses)), up, atol=1e-6)


def test_upright_turns_up_to_z_and_size_scales_the_cameras(addon):
    capture = capture_of(arc(360, TILTED))
    matrix = addon.cameras.world_matrix(capture, "upright", 12.0)
    scale = 12.0 / addon.cameras.extent_of(capture)
    np.testing.assert_allclose(matrix[:3, :3] @ TILTED @ (0, 0, 1), [0, 0, scale], atol=2e-3)
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], scale**2 * np.eye(3), atol=1e-9)


@pytest.mark.parametrize(
    ("format_name", "splats", "orientation", "is_turned"),
    [
        ("colmap", None, "auto", True),
        ("llff", None, "auto", True),
        ("transforms", None, "auto", False),
        ("nerf-synthetic", None, "auto", False),
        ("transforms", "garden.ply", "auto", True),  # the world of another program
        ("colmap", None, "file", False),
    ],
)
def test_automatic_turns_only_formats_without_known_axes(addon, format_name, splats, orientation, is_turned):
    capture = capture_of(arc(360, TILTED), format_name, splats)
    matrix = addon.cameras.world_matrix(capture, orientation, 0.0)
    assert (matrix == np.eye(4)).all() != is_turned
    assert np.allclose(matrix, np.eye(4)) != is_turned


def test_single_camera_has_an_extent(addon):
    assert addon.cameras.extent_of(capture_of([np.eye(4)])) == 1.0


def test_captured_cameras_are_locked_those_of_earlier_files_when_looked_through(bpy, addon, shot):
    camera = bpy.data.objects["photo_1"]
    locks = ("lock_location", "lock_rotation", "lock_scale")
    assert all(all(getattr(camera, lock)) for lock in locks)
    camera.lock_location = (False, False, False)
    addon.steps.look_through(shot, "photo_1")
    assert all(camera.lock_location)


def eye_of(view):
    """The place that a 3D View is seen from."""
    return np.array(view.view_location) + view.view_distance * np.array(view.view_rotation.to_matrix())[:, 2]


def view_of(camera, distance):
    """A 3D View at a camera's place, turning about a point at a distance."""
    matrix = camera.matrix_world.normalized()
    location = matrix.translation - distance * matrix.col[2].xyz
    turn = {"view_rotation": matrix.to_quaternion(), "view_distance": distance}
    return SimpleNamespace(view_perspective="PERSP", view_location=location, **turn)


def test_views_turn_about_what_the_cameras_look_at(bpy, addon, shot):
    shot.karf.rig.location = (1, 2, 3)  # the captured cameras look at the rig's origin
    bpy.context.view_layer.update()
    view = view_of(bpy.data.objects["photo_1"], 40.0)
    addon.cameras.turn_about(view, shot)
    np.testing.assert_allclose(view.view_location, (1, 2, 3), atol=1e-5)
    assert view.view_distance == pytest.approx(3, abs=1e-4)
    np.testing.assert_allclose(
        eye_of(view), bpy.data.objects["photo_1"].matrix_world.translation, atol=1e-5
    )  # seen as before
    through = SimpleNamespace(view_perspective="CAMERA")
    addon.cameras.turn_about(through, shot)
    np.testing.assert_allclose(through.view_location, (1, 2, 3), atol=1e-5)


@pytest.mark.parametrize(("perspective", "distances"), [("PERSP", (44.0, 43.0)), ("ORTHO", (40.0, 40.0))])
def test_views_turn_about_the_active_object_once_it_is_segmented(bpy, addon, shot, perspective, distances):
    shot.karf.rig.location = (1, 2, 3)
    bpy.context.view_layer.update()
    view = next(addon.windows.areas("VIEW_3D")).spaces.active.region_3d
    view.view_perspective, view.view_rotation = perspective, (1, 0, 0, 0)  # looks along -z
    view.view_location, view.view_distance = (5, 6, 7), 40.0
    addon.steps.learn_scene(shot).wait()
    for name in ("lid", "pot"):
        addon.steps.add_object(shot, name)
        addon.steps.mark_stroke(shot, [(5, 5)], 3)
    shot.karf.marking.active = 0
    assert tuple(view.view_location) == (5, 6, 7)  # nobody knows where the lid is
    addon.steps.segment(shot).wait()
    np.testing.assert_allclose(view.view_location, (5, 6, 3), atol=1e-5)  # the fake engine's lid is at the rig's origin
    assert view.view_distance == pytest.approx(distances[0])  # the eye stays
    shot.karf.marking.active = 1
    np.testing.assert_allclose(view.view_location, (5, 6, 4), atol=1e-5)  # the pot is above
    assert view.view_distance == pytest.approx(distances[1])


def test_new_camera_has_the_view_and_the_lens_looked_through_and_is_free(bpy, addon, shot):
    seen = bpy.data.objects["photo_0"]
    camera = addon.cameras.add_free(shot, seen.matrix_world.inverted(), 50.0)
    assert shot.camera == camera and camera.parent is None and not any(camera.lock_location)
    np.testing.assert_allclose(camera.matrix_world, seen.matrix_world, atol=1e-6)
    assert camera.data.lens == seen.data.lens and not camera.data.background_images and seen.data.background_images
    assert not shot.karf.looking.is_on and shot.render.resolution_x == 1998
    camera.location.z += 7
    bpy.context.view_layer.update()
    other = addon.cameras.add_free(shot, seen.matrix_world.inverted(), 50.0)
    assert other.data.lens == 25.0


def test_parallel_cameras_leave_a_view_as_it_is(bpy, addon, shot):
    for item in shot.karf.rig.children:
        item.rotation_euler = (0, 0, 0)
    view = view_of(bpy.data.objects["photo_1"], 40.0)
    addon.cameras.turn_about(view, shot)
    assert view.view_distance == 40.0


@pytest.mark.parametrize(("has_work", "transform"), [(False, "Standard"), (True, "AgX")])
def test_import_into_a_new_scene_shows_the_photos_colors(
    bpy, addon, scene, capture_folder, tmp_path, has_work, transform
):
    if has_work:
        scene.collection.objects.link(bpy.data.objects.new("Mine", None))
    capture = addon.steps.import_capture(scene, capture_folder, tmp_path / "project")
    assert scene.view_settings.view_transform == transform
    assert any("Standard" in remark for remark in capture.warnings) != has_work
    bpy.ops.karf.standard_colors()
    assert scene.view_settings.view_transform == "Standard"
