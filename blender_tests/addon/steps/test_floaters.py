"""Splats in delete boxes are deleted at the boxes' places, with the boxes, and come back."""

import json

import numpy as np
import pytest


def boxes_given(addon, scene):
    """The boxes that the engine received, [n, 4, 4]."""
    file = addon.folders.project_of(scene).folder / "boxes.json"
    return np.reshape(json.loads(file.read_text()), (-1, 4, 4))


def names(scene):
    return [item.name for item in scene.objects if item.name.startswith("KaRF Delete Box")]


def test_new_box_is_selected_alone_and_half_as_large_as_the_rigs_axes(bpy, addon, with_splats):
    rig = with_splats.karf.rig
    rig.empty_display_size, rig.scale, with_splats.cursor.location = 0.5, (3, 3, 3), (1, 2, 3)
    bpy.context.view_layer.update()
    assert bpy.ops.karf.add_delete_box() == {"FINISHED"}
    box = bpy.context.object
    assert bpy.context.selected_objects == [box] and names(with_splats) == ["KaRF Delete Box"]
    assert box.type == "EMPTY" and box.empty_display_type == "CUBE"
    assert tuple(box.location) == (1, 2, 3) and np.allclose(box.scale, 0.75)
    assert tuple(addon.steps.add_delete_box(with_splats, (4, 5, 6)).location) == (4, 5, 6)


def test_only_splats_in_selected_boxes_are_deleted_with_these_boxes(bpy, addon, with_splats):
    rig, first = with_splats.karf.rig, addon.steps.add_delete_box(with_splats)
    rig.location, rig.rotation_euler, rig.scale = (1, 2, 3), (0.5, 0, 0.2), (2, 2, 2)
    first.location, first.rotation_euler, first.scale = (4, -1, 2), (0.3, 0.7, -1), (1, 2, 0.5)
    first.empty_display_size = 3
    bpy.context.view_layer.update()
    wanted = np.linalg.inv(rig.matrix_world) @ np.array(first.matrix_world) @ np.diag((3, 3, 3, 1))
    other, moved = addon.steps.add_delete_box(with_splats), bpy.data.objects.new("lamp", None)
    with_splats.collection.objects.link(moved)
    for item in (first, moved):
        item.select_set(True)
    other.select_set(False)
    assert bpy.ops.karf.delete_inside() == {"FINISHED"}
    (given,) = boxes_given(addon, with_splats)
    np.testing.assert_allclose(given, wanted, atol=1e-5)
    assert names(with_splats) == ["KaRF Delete Box.001"] and "lamp" in with_splats.objects
    assert addon.disk.contents_of(with_splats).erased == 1


def test_parent_moves_a_box_and_restore_brings_splats_back(bpy, addon, with_splats):
    box, parent = addon.steps.add_delete_box(with_splats), bpy.data.objects.new("parent", None)
    with_splats.collection.objects.link(parent)
    box.parent, parent.location = parent, (7, 0, 0)
    assert addon.steps.delete_inside(with_splats, [box]).wait() == 1
    rig = np.array(with_splats.karf.rig.matrix_world)
    np.testing.assert_allclose((rig @ boxes_given(addon, with_splats)[0])[:3, 3], (7, 0, 0), atol=1e-5)
    assert bpy.ops.karf.restore_splats() == {"FINISHED"}
    assert addon.disk.contents_of(with_splats).erased == 0 and not len(boxes_given(addon, with_splats))


def test_buttons_say_what_is_missing(bpy, addon, learned):
    operators = [bpy.ops.karf.add_delete_box, bpy.ops.karf.delete_inside, bpy.ops.karf.restore_splats]
    assert not any(operator.poll() for operator in operators), "no splats"
    addon.steps.learn_splats(learned).wait()
    assert [operator.poll() for operator in operators] == [True, False, True], "no box"
    bpy.ops.karf.add_delete_box()
    assert bpy.ops.karf.delete_inside.poll()
    with pytest.raises(addon.steps.KarfError, match="No delete box"):
        addon.steps.delete_inside(learned, [])


def test_boxes_stay_where_deleting_fails(bpy, addon, with_splats):
    box = addon.steps.add_delete_box(with_splats)
    task = addon.steps.delete_inside(with_splats, [box])
    task.requests[0].options["behave"] = "error"
    with pytest.raises(addon.steps.KarfError, match="missing"):
        task.wait()
    assert names(with_splats) == [box.name]
