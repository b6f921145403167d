"""The learned scene as an object: its colors equal the engine's, follow the swatches and are exported."""

import dataclasses
import json
import struct
from types import SimpleNamespace

import numpy as np
import pytest

from ..conftest import run_without_extension
from ..fake_engine.__main__ import LEARNED

NAMES = tuple(LEARNED)
EDIT = {("lid", 1): (0.9, 0.1, 0.6), ("pot", 1): (0.1, 0.3, 0.9), ("pot", 2): (0.3, 1.4, 0.2)}


@pytest.fixture
def points(addon):
    """Fifty points of the fake engine's objects."""
    random, n = np.random.default_rng(1), 50
    normals = random.normal(size=(n, 3))
    shares = random.dirichlet(np.ones(3), (n, 2))
    probabilities = random.dirichlet(np.ones(3), n)[:, :2]
    return addon.engine_api.ScenePoints(
        NAMES,
        random.normal(size=(n, 3)).astype(np.float32),
        (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        np.full(n, 0.1, np.float32),
        random.integers(0, 256, (n, 3), np.uint8),
        probabilities.astype(np.float16),
        (shares * probabilities[:, :, None]).astype(np.float16),
        np.array(list(LEARNED.values()), np.float32),
    )


@pytest.fixture
def points_file(addon, points, tmp_path):
    addon.engine_api.write_points(tmp_path / "points.npz", points)
    return tmp_path / "points.npz"


@pytest.fixture
def shown(addon, learned, points_file):
    return addon.steps.place_points(learned, points_file)


def read_colors(attribute):
    flat = np.empty(4 * len(attribute.data), np.float32)
    attribute.data.foreach_get("color_srgb", flat)
    return flat.reshape(-1, 4)[:, :3]


def colors_of(bpy, item):
    """The shown colors of the faces, [n, 3] sRGB; each face has one."""
    data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert data.color_attributes.active_color_name == "Color"
    corners = read_colors(data.attributes["Color"]).reshape(len(data.polygons), 4, 3)
    np.testing.assert_array_equal(corners, np.broadcast_to(corners[:, :1], corners.shape))
    return corners[:, 0]


def set_edit(bpy, addon):
    for (name, index), color in EDIT.items():
        addon.steps.set_swatch(bpy.context.scene, name, index, color)


def recolored(points):
    edited = points.learned.copy()
    for (name, index), color in EDIT.items():
        edited[NAMES.index(name), index] = color
    return points.recolored(edited)


def test_3d_views_switch_to_colors_only_the_first_time(bpy, addon, learned, points_file):
    area = bpy.data.window_managers[0].windows[0].screen.areas[0]
    area.type = "VIEW_3D"
    shading = area.spaces.active.shading
    shading.type, shading.light, shading.color_type = "SOLID", "STUDIO", "MATERIAL"
    addon.steps.place_points(learned, points_file)
    assert (shading.light, shading.color_type) == ("FLAT", "VERTEX")
    shading.light = "STUDIO"
    addon.steps.place_points(learned, points_file)
    assert shading.light == "STUDIO"


def test_points_are_faces_recolored_as_by_the_engine(bpy, addon, learned, points, points_file, shown):
    data = shown.data
    assert shown.parent == learned.karf.rig and len(data.polygons) == len(points)
    assert {"Color", "normal", "karf/lid", "karf/pot", "karf/lid/1", "karf/pot/2"} <= set(data.attributes.keys())
    centers = np.array([face.center for face in data.polygons])
    np.testing.assert_allclose(centers, points.positions, atol=1e-5)
    facing = np.abs(np.sum([np.array(f.normal) * n for f, n in zip(data.polygons, points.normals, strict=True)], 1))
    assert facing.min() > 0.999
    weights = np.empty(len(points), np.float32)
    data.attributes["karf/pot/2"].data.foreach_get("value", weights)
    np.testing.assert_array_equal(weights, points.palette_weights[:, 1, 2])
    np.testing.assert_allclose(colors_of(bpy, shown) * 255, points.colors, atol=0.01)
    set_edit(bpy, addon)
    assert_recolored(bpy, shown, points)
    bpy.data.objects.remove(shown)
    assert addon.scene_object.find(learned) is None
    made = addon.steps.place_points(learned, points_file)
    assert addon.scene_object.find(learned) == made
    assert_recolored(bpy, made, points)


def assert_recolored(bpy, item, points):
    assert np.abs(colors_of(bpy, item) - recolored(points)).max() < 0.51 / 255
    assert np.abs(recolored(points) - points.colors / 255).max() > 0.3


def test_keyframed_swatches_are_followed(bpy, addon, learned, points, shown):
    for frame, edit in ((1, lambda: None), (3, lambda: set_edit(bpy, addon))):
        edit()
        for name, index in EDIT:
            learned.karf.objects[name].swatches[index].keyframe_insert("color", frame=frame)
    learned.frame_set(1)
    np.testing.assert_allclose(colors_of(bpy, shown) * 255, points.colors, atol=0.01)
    learned.frame_set(3)
    assert_recolored(bpy, shown, points)


def test_radius_scales_faces_and_survives_a_new_import(bpy, addon, learned, points, points_file, shown):
    def sides():
        data = shown.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        return np.array([face.area for face in data.polygons]) ** 0.5, np.array([f.center for f in data.polygons])

    def count():
        return len(bpy.data.meshes), len(bpy.data.node_groups), len(bpy.data.objects)

    before, centers = sides()
    addon.scene_object.radius_node(shown).outputs[0].default_value = 2
    after, same = sides()
    np.testing.assert_allclose(after, 2 * before, rtol=1e-3)
    np.testing.assert_allclose(same, centers, atol=1e-5)
    shown.location.x, shown.hide_render, known = 3, True, count()
    again = addon.steps.place_points(learned, points_file)
    assert again == shown and again.location.x == 3 and again.hide_render and count() == known
    assert addon.scene_object.radius_node(again).outputs[0].default_value == 2
    set_edit(bpy, addon)
    assert_recolored(bpy, again, points)


SAVE_COLORS = """
item = bpy.data.objects["KaRF scene"]
data = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
flat = np.empty(16 * len(data.polygons), np.float32)
data.attributes["Color"].data.foreach_get("color_srgb", flat)
np.save(out, flat.reshape(-1, 4, 4)[:, 0, :3])
"""


def test_saved_file_shows_its_colors_without_the_extension(bpy, addon, points, shown, tmp_path):
    set_edit(bpy, addon)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    run_without_extension(SAVE_COLORS, tmp_path / "scene.blend", tmp_path / "colors.npy")
    assert np.abs(np.load(tmp_path / "colors.npy") - recolored(points)).max() < 0.51 / 255


def test_requested_number_of_points_reaches_the_engine(addon, learned, points_file, monkeypatch):
    monkeypatch.setenv("FAKE_POINTS", str(points_file))
    item = addon.steps.show_scene(learned, count=7000).wait()
    assert len(item.data.polygons) == 50
    (job,) = sorted((addon.folders.project_of(learned).folder / "jobs").glob("*-points"))
    assert addon.engine_api.read_json(job / "request.json", "request")["options"]["count"] == 7000


def test_points_of_other_palettes_warn_and_keep_their_colors(bpy, addon, learned, points, points_file):
    learned.karf.objects["pot"].swatches[1].learned = (0.5, 0.5, 0.5)
    shown = addon.steps.place_points(learned, points_file)
    set_edit(bpy, addon)
    assert "The swatches of pot belong to other palettes than the points" in addon.progress.state().warnings
    assert np.abs(colors_of(bpy, shown) - recolored(points)).max() > 0.1


def glb_colors(addon, path):
    """The distinct colors of a binary glTF's vertices, sRGB 0..255 [n, 3]; not every Blender reads those of points."""
    content = path.read_bytes()
    (size,) = struct.unpack("<I", content[12:16])
    head, binary = json.loads(content[20 : 20 + size]), content[28 + size :]
    (primitive,) = head["meshes"][0]["primitives"]
    accessor = head["accessors"][primitive["attributes"]["COLOR_0"]]
    view = head["bufferViews"][accessor["bufferView"]]
    kind = {5123: np.uint16, 5126: np.float32}[accessor["componentType"]]
    values = np.frombuffer(binary, kind, 4 * accessor["count"], view.get("byteOffset", 0)).reshape(-1, 4)
    linear = values[:, :3] / (65535 if kind is np.uint16 else 1)
    return np.unique(np.rint(addon.engine_api.linear_to_srgb(linear) * 255).astype(int), axis=0)


def imported(bpy, addon, path):
    """The distinct colors of a file's points or faces, as Blender imports them, sRGB 0..255 [n, 3]."""
    if path.suffix == ".glb":
        return glb_colors(addon, path)
    bpy.ops.wm.read_homefile(use_empty=True)
    read = bpy.ops.wm.ply_import if path.suffix == ".ply" else bpy.ops.wm.usd_import
    read(filepath=str(path))
    (item,) = [each for each in bpy.data.objects if each.type == "MESH" and not each.name.startswith("Icosphere")]
    return np.unique(np.rint(read_colors(item.data.color_attributes[0]) * 255).astype(int), axis=0)


@pytest.mark.parametrize(
    ("name", "shape"),
    [("a.ply", "quads"), ("a.ply", "points"), ("a.glb", "quads"), ("a.glb", "points"), ("a.usdc", "quads")],
)
def test_exported_file_has_the_recolored_colors(bpy, addon, points, shown, tmp_path, name, shape):
    if (name, shape) == ("a.glb", "points") and bpy.app.version < (4, 3, 0):
        with pytest.raises(addon.engine_api.BadRequest, match="cannot write points to glTF"):
            addon.steps.export_scene(bpy.context.scene, tmp_path / name, shape)
        return
    set_edit(bpy, addon)

    def in_file():
        return bpy.data.objects.keys(), bpy.data.materials.keys(), list(bpy.context.selected_objects)

    kept = in_file()
    addon.steps.export_scene(bpy.context.scene, tmp_path / name, shape)
    assert in_file() == kept
    wanted, found = recolored(points) * 255, imported(bpy, addon, tmp_path / name)
    distances = np.abs(wanted[:, None] - found[None]).max(2)  # exporters round differently
    assert distances.min(1).max() < 2 and distances.min(0).max() < 2


def test_impossible_exports_are_rejected(addon, learned, points_file, tmp_path):
    with pytest.raises(addon.engine_api.BadRequest, match="not shown in 3D yet"):
        addon.steps.export_scene(learned, tmp_path / "a.ply")
    addon.steps.place_points(learned, points_file)
    with pytest.raises(addon.engine_api.BadRequest, match="unknown file extension"):
        addon.steps.export_scene(learned, tmp_path / "a.obj")
    with pytest.raises(addon.engine_api.BadRequest, match="shows single points"):
        addon.steps.export_scene(learned, tmp_path / "a.usdc", "points")


def test_objects_with_long_names_keep_their_own_weights(bpy, addon, points):
    names = ["鍋" * 60 + end for end in "ab"]
    attributes = {addon.scene_object.weight_attribute(name, 1) for name in names}
    data = bpy.data.meshes.new("long")
    assert {data.attributes.new(name, "FLOAT", "FACE").name for name in attributes} == attributes
    assert len(attributes) == 2


def test_points_follow_the_edges_of_the_scene(bpy, addon, learned, points, tmp_path):
    inside = points.probabilities[:, 1] > 0.5
    distances = np.where(inside, 1, -1)[:, None] * np.ones((1, 2), np.float32)
    borders = addon.engine_api.Borders(distances.astype(np.float32), np.ones(2, np.float32), np.ones(2, np.float32))
    addon.engine_api.write_points(tmp_path / "points.npz", dataclasses.replace(points, borders=borders))
    addon.steps.set_swatch(learned, "pot", 1, EDIT["pot", 1])
    learned.karf.objects["pot"].choke = 2  # farther than any point from the border
    item = addon.steps.place_points(learned, tmp_path / "points.npz")
    np.testing.assert_allclose(colors_of(bpy, item) * 255, points.colors, atol=0.01)


EXPORTS = {
    "export_cameras": "cameras.json",
    "export_scene": "scene.ply",
    "export_splat": "scene.ply",
    "save_edit": "edit.json",
}


@pytest.mark.parametrize("name", EXPORTS)
@pytest.mark.parametrize("is_saved", [False, True])
def test_dialogs_propose_the_exported_files_name(bpy, addon, learned, tmp_path, name, is_saved):
    folder = addon.folders.project_of(learned).folder
    if is_saved:
        folder = tmp_path / "shots"
        folder.mkdir()
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    opened = SimpleNamespace(window_manager=SimpleNamespace(fileselect_add=lambda each: None), scene=bpy.context.scene)
    dialog = SimpleNamespace(properties=SimpleNamespace(is_property_set=lambda each: False), filepath=EXPORTS[name])
    kind = getattr(bpy.types, f"KARF_OT_{name}")
    assert getattr(bpy.ops.karf, name).get_rna_type().properties["filepath"].default == EXPORTS[name]
    assert kind.invoke(dialog, opened, None) == {"RUNNING_MODAL"}
    assert dialog.filepath == str(folder / EXPORTS[name])
