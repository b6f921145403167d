"""Colors are written to objects of splats: point clouds of Blender and meshes of KIRI's add-on."""

import numpy as np
import pytest

from .splat_objects import KINDS, N, colors_of, make

C0 = 0.28209479177387814


@pytest.fixture
def harmonics():
    """[N, 3 * 4], degree 1."""
    return np.random.default_rng(2).normal(size=(N, 12)).astype(np.float32)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 4, 9])
def test_points_get_common_harmonics_and_keep_the_rest(bpy, addon, harmonics, kind, count):
    item = make(bpy, kind, count)
    before, opacities = colors_of(item)
    bpy.context.view_layer.update()
    addon.splat_objects.write(item, harmonics)
    drawn = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    for each in (item, drawn):
        found, after = colors_of(each)
        np.testing.assert_array_equal(found[:, :4], harmonics.reshape(N, 4, 3)[:, :count])
        np.testing.assert_array_equal(found[:, 4:], before[:, 4:])
        np.testing.assert_array_equal(after, opacities)


def test_kiris_color_is_the_clipped_direct_part(bpy, addon, harmonics):
    item = make(bpy, "kiri", 4)
    harmonics[0, :3] = 9, -9, 0
    addon.splat_objects.write(item, harmonics)
    shown = np.empty((N, 4), np.float32)
    item.data.attributes["Col"].data.foreach_get("color", shown.ravel())
    np.testing.assert_allclose(shown[:, :3], np.clip(0.5 + C0 * harmonics[:, :3], 0, 1), atol=1e-6)
    np.testing.assert_array_equal(shown[0, :3], [1, 0, 0.5])
    np.testing.assert_allclose(shown[:, 3], 0.25)
    item = make(bpy, "kiri", 4)
    item.data.attributes.remove(item.data.attributes["Col"])
    addon.splat_objects.write(item, harmonics)
    np.testing.assert_array_equal(colors_of(item)[0].reshape(N, -1), harmonics)


@pytest.mark.parametrize("kind", KINDS)
def test_wrong_number_of_points_is_rejected(bpy, addon, harmonics, kind):
    item = make(bpy, kind, 4)
    before = colors_of(item)[0]
    sentence = f"{item.name} has {N} points, but there are colors for 3 splats"
    with pytest.raises(addon.engine_api.BadRequest, match=sentence):
        addon.splat_objects.write(item, harmonics[:3])
    np.testing.assert_array_equal(colors_of(item)[0], before)


def test_64_points_stand_for_many(bpy, addon):
    points = addon.splat_objects.points_of(make(bpy, "kiri", 1, 1000))
    rows = points["rows"]
    assert rows[0] == 0 and rows[-1] == 999 and len(set(rows)) == len(points["positions"]) == 64
    assert points["positions"][-1] == [999, 999**2, -999]
    assert addon.splat_objects.points_of(make(bpy, "kiri", 1, 0)) == {"count": 0, "rows": [], "positions": []}


def test_other_objects_are_not_splats(bpy, addon):
    is_splat = addon.splat_objects.is_splat
    mesh = bpy.data.objects.new("mesh", bpy.data.meshes.new("mesh"))
    mesh.data.attributes.new("f_dc_0", "FLOAT", "POINT")
    others = (None, bpy.data.objects.new("empty", None), mesh, bpy.data.objects.new("p", bpy.data.pointclouds.new("p")))
    assert not any(is_splat(item) for item in others)
    assert is_splat(make(bpy, "kiri", 1))
