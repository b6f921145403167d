"""Splats of other programs come in, and ours go out, by operators and by scripts."""

import json
from pathlib import Path

import numpy as np
import pytest

COLMAP_TO_BLENDER = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture
def splat(tmp_path):
    path = tmp_path / "garden.ply"
    path.write_bytes(b"ply of others")
    return path


@pytest.fixture
def imported(bpy, addon, scene, splat, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert bpy.ops.karf.import_splat(filepath=str(splat), views=2) == {"FINISHED"}
    return scene


def asked(path):
    return json.loads(path.read_text())


# ------------------------------------------------------------------------------------------------------------------ in
def test_a_splat_becomes_an_imported_capture_beside_the_blend(addon, imported, tmp_path):
    karf = imported.karf
    assert addon.folders.absolute(karf.project) == tmp_path / "garden_karf"
    assert addon.folders.absolute(karf.capture) == tmp_path / "garden_karf" / "capture"
    assert karf.views.keys() == ["view_000", "view_001"] and karf.active_view == "view_000"
    assert addon.captures.of(imported).splats.path == tmp_path / "garden_karf" / "capture" / "garden.ply"


def test_it_stands_upright_whatever_its_file_says(imported):
    turn = np.array(imported.karf.rig.matrix_world)[:3, :3]
    np.testing.assert_allclose(turn @ [0, -1, 0], [0, 0, 1], atol=1e-5)


def test_what_is_chosen_reaches_the_engine(addon, scene, splat, tmp_path):
    task = addon.steps.import_splat(scene, splat, None, tmp_path / "cameras.json", views=7, up="-y", antialiased=True)
    (request,) = task.requests
    assert request.stage == "import-splat"
    known = {
        "cameras": str(tmp_path / "cameras.json"),
        "splat": str(splat),
        "views": 7,
        "up": "-y",
        "antialiased": True,
    }
    assert known == {name: request.options[name] for name in known}


def test_with_photos_the_engine_is_not_asked_for_views(addon, scene, splat, tmp_path):
    """It refuses both; the dialog remembers what was chosen for another file."""
    (request,) = addon.steps.import_splat(scene, splat, tmp_path / "photos", views=7, up="-y").requests
    assert request.options["photos"] == str(tmp_path / "photos")
    assert not {"views", "up"} & set(request.options)


def test_learned_it_is_shown_by_its_own_splats_at_once(addon, imported):
    addon.steps.learn_scene(imported).wait()
    assert "splats" in addon.disk.read(imported).stages


def test_photos_have_splats_to_be_learned_by_a_button(addon, project_scene):
    addon.steps.learn_scene(project_scene).wait()
    assert "splats" not in addon.disk.read(project_scene).stages


def test_blenders_menus_lead_there(bpy, addon):
    for menu, name in (("import", "karf.import_splat"), ("export", "karf.export_splat")):
        draw = getattr(bpy.types, f"TOPBAR_MT_file_{menu}")._dyn_ui_initialize()
        assert any(function.__module__.endswith("panels.sidebar") for function in draw), name


# ----------------------------------------------------------------------------------------------------------------- out
@pytest.fixture
def with_splats(addon, learned):
    addon.steps.learn_splats(learned).wait()
    return learned


def test_it_goes_out_with_the_swatches_as_they_stand(bpy, addon, with_splats, tmp_path):
    addon.steps.set_swatch(with_splats, "pot", 1, (0.1, 0.2, 0.9))
    assert bpy.ops.karf.export_splat(filepath=str(tmp_path / "blue.ply")) == {"FINISHED"}
    edit = asked(tmp_path / "blue.ply")["edit"]
    np.testing.assert_allclose(
        json.loads(Path(edit).read_text())["objects"]["pot"]["colors"][1], (0.1, 0.2, 0.9), atol=1e-6
    )


def test_it_lies_in_the_file_where_the_rig_stands(bpy, addon, with_splats, tmp_path):
    rig = with_splats.karf.rig
    rig.location, rig.rotation_euler, rig.scale = (1, 2, 3), (0.5, 0, 0), (2, 2, 2)
    bpy.context.view_layer.update()
    addon.steps.export_splat(with_splats, tmp_path / "here.ply").wait()
    matrix = np.reshape(asked(tmp_path / "here.ply")["matrix"], (4, 4))
    np.testing.assert_allclose(matrix, np.array(rig.matrix_world), atol=1e-6)


@pytest.mark.parametrize(("name", "axes"), [("here.glb", "blender"), ("here.spz", "blender"), ("here.ply", "viewers")])
def test_blenders_up_is_up_for_other_programs(addon, with_splats, tmp_path, name, axes):
    """A PLY file has y down, from which other kinds are written with y up."""
    addon.steps.export_splat(with_splats, tmp_path / name, axes=axes).wait()
    matrix = np.reshape(asked(tmp_path / name)["matrix"], (4, 4))
    expected = COLMAP_TO_BLENDER.T @ np.array(with_splats.karf.rig.matrix_world)[:3, :3]
    np.testing.assert_allclose(matrix[:3, :3], expected, atol=1e-6)
    np.testing.assert_allclose(COLMAP_TO_BLENDER.T @ [0, 0, 1], [0, -1, 0])


def test_one_object_can_be_cut_out(bpy, with_splats, tmp_path):
    bpy.ops.karf.export_splat(filepath=str(tmp_path / "pot.ply"), object_name="pot", solid=True, attributes=True)
    given = asked(tmp_path / "pot.ply")
    assert given["objects"] == ["pot"] and given["solid"] and given["attributes"]


def test_imported_splats_go_out_where_they_came_from(addon, imported, tmp_path):
    addon.steps.learn_scene(imported).wait()
    addon.steps.export_splat(imported, tmp_path / "back.ply").wait()
    assert "matrix" not in asked(tmp_path / "back.ply")


def test_without_splats_the_button_says_what_is_missing(bpy, learned):
    assert not bpy.ops.karf.export_splat.poll()


def test_wrong_axes_are_refused(addon, with_splats, tmp_path):
    with pytest.raises(addon.steps.KarfError, match="axes"):
        addon.steps.export_splat(with_splats, tmp_path / "x.ply", axes="mars").wait()
