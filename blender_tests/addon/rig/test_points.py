"""Sparse points in the viewport, and their reprojection errors."""

import numpy as np
import pytest

SIZE = (200, 150)
LENS = (-0.2, 0.05, 0.001, -0.002)  # COLMAP's OPENCV model: k1 k2 p1 p2


@pytest.fixture
def colmap_folder(addon, tmp_path):
    """A COLMAP text model of two photos that observe 40 points: 3 pixels off in the first, exactly in the second."""
    api, random = addon.engine_api, np.random.default_rng(0)
    positions = random.uniform([-1, -1, 4], [1, 1, 6], (40, 3))
    colors = random.integers(0, 256, (40, 3))
    model = tmp_path / "shelf" / "sparse" / "0"
    model.mkdir(parents=True)
    lens = " ".join(map(str, (180.0, 185.0, 98.0, 77.0, *LENS)))
    (model / "cameras.txt").write_text(f"1 OPENCV {SIZE[0]} {SIZE[1]} {lens}\n")
    images = []
    for number, shift in ((1, 3.0), (2, 0.0)):
        pose = np.diag([1.0, -1.0, -1.0, 1.0])  # COLMAP's camera looks along +z, y down
        pose[0, 3] = 0.2 * number
        camera = api.Camera(*SIZE, 180.0, 185.0, 98.0, 77.0, pose, LENS)
        seen = api.distort(camera, camera.project(positions)[0]) + [shift, 0]
        row = " ".join(f"{u:.6f} {v:.6f} {i + 1}" for i, (u, v) in enumerate(seen))
        images.append(f"{number} 1 0 0 0 {-0.2 * number} 0 0 1 p{number}.png\n{row}\n")
        addon.images.write_png(tmp_path / "shelf" / "images" / f"p{number}.png", np.zeros((SIZE[1], SIZE[0], 3)))
    (model / "images.txt").write_text("".join(images))
    rows = enumerate(zip(positions, colors, strict=True))
    points = [f"{i + 1} {x} {y} {z} {r} {g} {b} {0.5 * i} 1 {i} 2 {i}\n" for i, ((x, y, z), (r, g, b)) in rows]
    (model / "points3D.txt").write_text("".join(points))
    return tmp_path / "shelf"


@pytest.fixture
def imported(addon, scene, colmap_folder, tmp_path):
    addon.steps.import_capture(scene, colmap_folder, tmp_path / "project")
    return scene


def column(attribute, name, width):
    values = np.empty(len(attribute.data) * width, np.float32)
    attribute.data.foreach_get(name, values)
    return values.reshape(-1, width)


def test_points_are_balls_with_color_and_error(bpy, addon, imported):
    points = addon.captures.of(imported).points
    item = next(child for child in imported.karf.rig.children if child.type == "MESH")
    assert len(item.data.vertices) == imported.karf.n_points == 40 and not item.data.edges
    coordinates = np.empty(120, np.float32)
    item.data.vertices.foreach_get("co", coordinates)
    np.testing.assert_allclose(coordinates.reshape(-1, 3), points.positions, atol=1e-6)
    color, error = item.data.attributes["color"], item.data.attributes["error"]
    assert color.data_type == "BYTE_COLOR" and color.domain == "POINT"
    np.testing.assert_allclose(column(color, "color_srgb", 4)[:, :3] * 255, points.colors, atol=1e-3)
    np.testing.assert_allclose(column(error, "value", 1)[:, 0], points.errors)
    assert item.hide_render and not item.hide_select
    imported.view_layers[0].update()
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert len(shown.polygons) == 40 * 8 and len(shown.vertices) == 40 * 6
    assert shown.color_attributes.active_color_name == "color"
    assert shown.materials[shown.polygons[0].material_index].name.startswith("KaRF points")


def test_errors_refer_to_the_stored_photo_even_without_points(addon, scene, colmap_folder, tmp_path):
    file = colmap_folder / "sparse" / "0" / "images.txt"  # a file of the model is the capture of its folder
    addon.steps.import_capture(scene, file, tmp_path / "project", rig=addon.steps.RigOptions(points=False))
    assert addon.folders.absolute(scene.karf.capture) == colmap_folder
    assert all(child.type == "CAMERA" for child in scene.karf.rig.children)
    first, second = (addon.steps.reprojection_error(scene, name) for name in ("p1", "p2"))
    assert (first.count, second.count) == (40, 40)
    assert first.median == pytest.approx(3, abs=1e-3) and first.worst == pytest.approx(3, abs=1e-3)
    assert second.worst < 1e-3


def test_overlay_draws_points_where_the_pinhole_shows_them(addon, imported):
    addon.steps.look_through(imported, "p1")
    overlay = addon.reprojection.of_camera(imported, imported.camera)
    assert overlay.view == "p1" and overlay.summary.count == 40
    camera = addon.captures.view_of(imported, "p1").camera
    projected, seen = (camera.project(places)[0] for places in (overlay.places[::2], overlay.places[1::2]))
    off = addon.engine_api.distort(camera, seen) - addon.engine_api.distort(camera, projected)
    np.testing.assert_allclose(off, np.broadcast_to([3.0, 0.0], (40, 2)), atol=0.01)
    assert (overlay.colors[:, 0] > overlay.colors[:, 1]).all()  # 3 of 4 pixels: nearer to red than to green


def test_errors_are_those_of_the_camera_looked_through(bpy, addon, imported, reopen):
    addon.steps.look_through(imported, "p1")
    imported.camera = addon.cameras.camera_of(imported, "p2")
    assert addon.reprojection.of_camera(imported, imported.camera) is None
    imported.karf.show_reprojection = True
    assert addon.reprojection.of_camera(imported, imported.camera).view == "p2"
    scene = reopen()
    assert not scene.karf.show_reprojection
    assert addon.reprojection.of_camera(scene, scene.camera) is None
    scene.karf.show_reprojection = True
    scene.camera = bpy.data.objects.new("film", bpy.data.cameras.new("film"))
    assert addon.reprojection.of_camera(scene, scene.camera) is None


def test_capture_without_points_is_rejected(addon, project_scene):
    with pytest.raises(addon.engine_api.DataError, match="no sparse points"):
        addon.steps.reprojection_error(project_scene)
    assert addon.reprojection.of_camera(project_scene, project_scene.camera) is None
