"""Camera animations are exported to transforms.json and imported back."""

import json

import numpy as np
import pytest


@pytest.fixture
def film(bpy, scene):
    """A camera whose location, rotation, lens and shifts are animated."""
    data = bpy.data.cameras.new("film")
    camera = bpy.data.objects.new("film", data)
    scene.collection.objects.link(camera)
    for frame, turn in ((1, 0.0), (12, 2.5)):
        camera.location = (3 * np.cos(turn), 3 * np.sin(turn), 1 + turn)
        camera.rotation_euler = (1.2 - 0.2 * turn, 0.1 * turn, turn + 1.5)
        data.lens, data.shift_x, data.shift_y = 35 + 10 * turn, 0.1 * turn, 0.05 - 0.03 * turn
        for path in ("location", "rotation_euler"):
            camera.keyframe_insert(path, frame=frame)
        for path in ("lens", "shift_x", "shift_y"):
            data.keyframe_insert(path, frame=frame)
    data.sensor_fit = "AUTO"
    scene.camera = camera
    scene.frame_start, scene.frame_end = 3, 9
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 600, 400, 50
    scene.render.pixel_aspect_y = 1.25
    return camera


def read_cameras(addon, path):
    return [view.camera for view in addon.engine_api.open_capture(path, photos=False).views]


def assert_cameras_equal(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert (a.width, a.height) == (b.width, b.height)
        np.testing.assert_allclose((a.fx, a.fy, a.cx, a.cy), (b.fx, b.fy, b.cx, b.cy), rtol=2e-6)
        np.testing.assert_allclose(a.camera_to_world, b.camera_to_world, atol=2e-6)


def test_round_trip_is_lossless(addon, scene, film, tmp_path):
    first = addon.steps.export_cameras(scene, tmp_path / "first.json")
    scene.frame_set(5)
    assert_cameras_equal(read_cameras(addon, first)[2:3], [addon.lens.pinhole(scene, film)])
    scene.render.resolution_percentage, scene.render.pixel_aspect_y = 100, 1.0
    scene.frame_start, scene.frame_end = 1, 250
    camera = addon.steps.import_cameras(scene, first)
    assert camera is not film and scene.camera == camera and scene.frame_current == 3
    assert (scene.frame_start, scene.frame_end) == (3, 9)
    second = addon.steps.export_cameras(scene, tmp_path / "second.json")
    assert json.loads(second.read_text())["frames"][0]["file_path"] == "frame_0003"
    assert_cameras_equal(read_cameras(addon, second), read_cameras(addon, first))


def test_round_trip_below_a_moved_rig_is_lossless(addon, project_scene, film, tmp_path):
    rig, scene = project_scene.karf.rig, project_scene
    rig.location, rig.rotation_euler, rig.scale = (2, -1, 0.5), (0.4, -0.2, 1.0), (1.7, 1.7, 1.7)
    first = addon.steps.export_cameras(scene, tmp_path / "first.json", frames=range(1, 13, 4))
    camera = addon.steps.import_cameras(scene, first)
    assert camera.parent == rig
    rig.location.x += 3  # the whole capture moves
    second = addon.steps.export_cameras(scene, tmp_path / "second.json", frames=range(1, 13, 4))
    assert_cameras_equal(read_cameras(addon, second), read_cameras(addon, first))


@pytest.fixture
def cameras_file(addon, tmp_path):
    """A function that writes cameras by their names, each 40 x 30 times a number, with this fy."""
    api = addon.engine_api

    def write(**sizes):
        views = []
        for name, (n, fy) in sizes.items():
            camera = api.Camera(40 * n, 30 * n, 35.0 * n, fy * n, 21.0 * n, 15.0 * n, np.eye(4))
            views.append(api.View(name, name, camera, None, "test"))
        api.write_cameras(tmp_path / "c.json", views)
        return tmp_path / "c.json"

    return write


def test_imported_cameras_get_frames_and_one_size(addon, scene, cameras_file, tmp_path):
    scene.frame_start = 7
    addon.steps.import_cameras(scene, cameras_file(left=(1, 35.0), right2=(1, 35.0)))
    assert (scene.frame_start, scene.frame_end) == (7, 8)
    file = cameras_file(f0=(1, 35.0), f1=(3, 35.0))
    addon.steps.import_cameras(scene, file)
    found = addon.steps.export_cameras(scene, tmp_path / "d.json")
    assert_cameras_equal(read_cameras(addon, found), read_cameras(addon, file)[:1] * 2)


def test_mixed_aspects_are_rejected_and_import_nothing(bpy, scene, cameras_file):
    file = str(cameras_file(f0=(1, 35.0), f1=(1, 30.0)))
    with pytest.raises(RuntimeError, match="'f1' and 'f0' have different resolutions or pixel aspects"):
        bpy.ops.karf.import_cameras(filepath=file)
    assert not bpy.data.objects


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_non_perspective_camera_is_rejected(bpy, addon, scene, film, tmp_path, kind):
    film.data.type = kind
    scene.frame_set(4)
    with pytest.raises(RuntimeError, match="'film' is not a perspective camera"):
        bpy.ops.karf.export_cameras(filepath=str(tmp_path / "cameras.json"))
    assert not (tmp_path / "cameras.json").exists() and scene.frame_current == 4


def test_export_without_a_camera_is_rejected(bpy, addon, scene, tmp_path):
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.karf.export_cameras(filepath=str(tmp_path / "cameras.json"))
    with pytest.raises(addon.engine_api.BadRequest, match="no camera"):
        addon.steps.export_cameras(scene, tmp_path / "cameras.json")
