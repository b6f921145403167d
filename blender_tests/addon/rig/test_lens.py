"""Blender's cameras and the pinhole model project alike, both ways."""

import numpy as np
import pytest

POINTS = np.array([[0.1, 0.2, -0.3], [-0.4, 0.3, 0.2], [0.5, -0.5, 0.1], [0.0, 0.0, 0.0]])


def pose():
    """A camera 3 units from the origin, turned a little about all axes."""
    a, b = 0.3, -0.2
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    tilt = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ tilt
    matrix[:3, 3] = matrix[:3, 2] * 3
    return matrix


CAMERAS = {
    "landscape": (800, 600, 700.0, 700.0, 400.0, 300.0),
    "portrait": (480, 640, 520.0, 520.0, 240.0, 320.0),
    "wide pixels": (640, 480, 500.0, 610.0, 320.0, 240.0),
    "high pixels": (640, 480, 610.0, 500.0, 320.0, 240.0),
    "off center": (800, 600, 700.0, 700.0, 437.5, 251.0),
    "portrait, wide pixels, off center": (301, 517, 333.0, 391.0, 177.0, 201.0),
}


def blender_pixels(bpy, scene, points):
    """The pixels, from the top left, where Blender projects world points."""
    scene.view_layers[0].update()
    render, camera = scene.render, scene.camera
    width, height = render.resolution_x, render.resolution_y
    aspects = {"scale_x": render.pixel_aspect_x, "scale_y": render.pixel_aspect_y}
    projection = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=width, y=height, **aspects)
    # the view has no scale, as in the 3D View and in renders
    matrix = np.array(projection @ camera.matrix_world.normalized().inverted())
    clip = np.concatenate([points, np.ones((len(points), 1))], 1) @ matrix.T
    device = clip[:, :2] / clip[:, 3:]
    return (device * (1, -1) + 1) / 2 * (width, height)


@pytest.fixture(params=CAMERAS.values(), ids=CAMERAS.keys())
def camera(request, addon):
    return addon.engine_api.Camera(*request.param, pose())


@pytest.mark.parametrize("is_moved", [False, True])
def test_rig_camera_equals_its_pinhole_wherever_the_rig_is(bpy, addon, scene, camera, tmp_path, is_moved):
    api = addon.engine_api
    capture = api.Capture(tmp_path, "test", (api.View("one", "one", camera, None, "train"),))
    scene.karf.rig = rig = addon.cameras.build(capture, "Rig", scene)
    addon.cameras.look_through(scene, capture.views[0])
    if is_moved:
        rig.location, rig.rotation_euler, rig.scale = (4, -2, 1), (0.3, 0.1, 2.0), (2.5, 2.5, 2.5)
    scene.view_layers[0].update()
    world = np.array(rig.matrix_world)
    points = POINTS @ world[:3, :3].T + world[:3, 3]
    expected, _ = camera.project(POINTS)
    assert np.abs(blender_pixels(bpy, scene, points) - expected).max() < 1e-3
    found = addon.lens.pinhole(scene, scene.camera)
    assert (found.width, found.height) == (camera.width, camera.height)
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy)
    np.testing.assert_allclose((found.fx, found.fy, found.cx, found.cy), numbers, atol=1e-3)
    np.testing.assert_allclose(found.camera_to_world, camera.camera_to_world, atol=1e-5)


def test_any_blender_camera_becomes_an_equal_pinhole(bpy, addon, scene):
    scene.camera = bpy.data.objects.new("film", bpy.data.cameras.new("film"))
    scene.collection.objects.link(scene.camera)
    scene.camera.location = (0.5, 0.2, 4)
    scene.camera.data.sensor_fit, scene.camera.data.shift_y = "AUTO", 0.13
    scene.camera.data.lens = 41
    scene.render.resolution_x, scene.render.resolution_y = 300, 500
    pixels, _ = addon.lens.pinhole(scene, scene.camera).project(POINTS)
    assert np.abs(blender_pixels(bpy, scene, POINTS) - pixels).max() < 1e-3


def test_sheared_or_mirrored_pose_is_rejected(addon):
    with pytest.raises(addon.engine_api.BadRequest, match="film"):
        addon.lens.rigid(np.array([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "film")
    with pytest.raises(addon.engine_api.BadRequest):
        addon.lens.rigid(np.diag([-1.0, 1, 1, 1]), "film")
