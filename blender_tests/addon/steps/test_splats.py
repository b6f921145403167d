"""Importing other programs' splats and exporting our own, by operators and scripts."""

import json
from pathlib import Path

import numpy as np
import pytest

COLMAP_TO_BLENDER = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture
def splat(tmp_path):
    path = tmp_path / "garden.ply"
    path.write_bytes(b"a foreign ply")
    return path


@pytest.fixture
def exported(addon, tmp_path):
    """Exports a scene's splats and returns the options that the engine received."""

    def export(scene, name="out.ply", **options):
        addon.steps.export_splat(scene, tmp_path / name, **options).wait()
        return json.loads((tmp_path / name).read_text())

    return export


def test_imported_splat_becomes_an_upright_capture_and_exports_unmoved(bpy, addon, scene, splat, exported, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.ops.karf.import_splat(filepath=str(splat), views=2) == {"FINISHED"}
    karf, folder = scene.karf, tmp_path / "garden_karf"
    assert addon.folders.absolute(karf.project) == folder
    assert addon.folders.absolute(karf.capture) == folder / "capture"
    assert karf.views.keys() == ["view_000", "view_001"] and karf.active_view == "view_000"
    assert addon.captures.of(scene).splats.path == folder / "capture" / "garden.ply"
    turn = np.array(karf.rig.matrix_world)[:3, :3]
    np.testing.assert_allclose(turn @ [0, -1, 0], [0, 0, 1], atol=1e-5)
    addon.steps.learn_scene(scene).wait()
    assert "splats" in addon.disk.read(scene).stages  # the imported ones, shown at once
    assert "matrix" not in exported(scene)


CAMERAS = {"views": 7, "up": "-y", "antialiased": True}


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        (CAMERAS | {"cameras_file": "/nowhere/c.json"}, CAMERAS | {"cameras": "/nowhere/c.json"}),
        # views and up may be left from another file in the dialog
        (CAMERAS | {"photos": "/nowhere"}, {"photos": "/nowhere", "views": None, "up": None}),
    ],
)
def test_import_options_reach_the_engine_except_views_with_photos(addon, scene, splat, given, wanted):
    (request,) = addon.steps.import_splat(scene, splat, **given).requests
    assert request.stage == "import-splat" and request.options["splat"] == str(splat)
    assert {name: request.options.get(name) for name in wanted} == wanted


def test_file_menus_offer_splats(bpy, addon):
    for menu, name in (("import", "karf.import_splat"), ("export", "karf.export_splat")):
        draw = getattr(bpy.types, f"TOPBAR_MT_file_{menu}")._dyn_ui_initialize()
        assert any(function.__module__.endswith("panels.sidebar") for function in draw), name


def test_exported_object_has_the_current_swatches(bpy, addon, with_splats, tmp_path):
    addon.steps.set_swatch(with_splats, "pot", 1, (0.1, 0.2, 0.9))
    file = tmp_path / "blue.ply"
    bpy.ops.karf.export_splat(filepath=str(file), object_name="pot", solid=True, attributes=True)
    given = json.loads(file.read_text())
    assert given["objects"] == ["pot"] and given["solid"] and given["attributes"]
    pot = json.loads(Path(given["edit"]).read_text())["objects"]["pot"]
    np.testing.assert_allclose(pot["colors"][1], (0.1, 0.2, 0.9), atol=1e-6)


@pytest.mark.parametrize(("name", "axes"), [("here.glb", "blender"), ("here.spz", "blender"), ("here.ply", "viewers")])
def test_exported_splats_follow_the_rig(bpy, with_splats, exported, name, axes):
    """PLY files have y down; other formats are converted from them with y up."""
    rig = with_splats.karf.rig
    rig.location, rig.rotation_euler, rig.scale = (1, 2, 3), (0.5, 0, 0), (2, 2, 2)
    bpy.context.view_layer.update()
    matrix = np.reshape(exported(with_splats)["matrix"], (4, 4))
    np.testing.assert_allclose(matrix, np.array(rig.matrix_world), atol=1e-6)
    matrix = np.reshape(exported(with_splats, name, axes=axes)["matrix"], (4, 4))
    expected = COLMAP_TO_BLENDER.T @ np.array(with_splats.karf.rig.matrix_world)[:3, :3]
    np.testing.assert_allclose(matrix[:3, :3], expected, atol=1e-6)
    np.testing.assert_allclose(COLMAP_TO_BLENDER.T @ [0, 0, 1], [0, -1, 0])


def test_learned_quality_is_the_panels_unless_the_call_says_otherwise(addon, learned):
    learned.karf.splat_quality = "good"
    assert addon.steps.learn_splats(learned).wait()["quality"] == "good"
    assert addon.steps.learn_splats(learned, "best").wait()["quality"] == learned.karf.splat_quality == "best"


def test_export_needs_splats_and_valid_axes(bpy, addon, learned, tmp_path):
    assert "splats" not in addon.disk.read(learned).stages and not bpy.ops.karf.export_splat.poll()
    addon.steps.learn_splats(learned).wait()
    with pytest.raises(addon.steps.KarfError, match="axes"):
        addon.steps.export_splat(learned, tmp_path / "x.ply", axes="mars").wait()
