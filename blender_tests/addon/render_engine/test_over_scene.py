"""Over Scene: Blender's own objects within the captured scene, by two renders of which the nearer one is seen."""

import pytest


@pytest.fixture
def scene(bpy, learned):
    """With a cube and a lamp of the artist's own."""
    learned.render.engine = "CYCLES"
    for data in (bpy.data.meshes.new("vase"), bpy.data.lights.new("lamp", "SUN")):
        learned.collection.objects.link(bpy.data.objects.new(data.name, data))
    learned.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    return learned


def test_the_objects_scene_has_all_but_the_capture(addon, scene):
    objects = addon.steps.put_objects_in(scene)
    assert {each.name for each in objects.objects} == {"vase", "lamp"}
    assert (scene.render.engine, objects.render.engine) == ("KARF", "CYCLES")
    assert objects.render.film_transparent and objects.camera == scene.camera


def test_pressed_again_it_holds_what_the_scene_holds_now(bpy, addon, scene):
    objects = addon.steps.put_objects_in(scene)
    bpy.data.objects.remove(bpy.data.objects["vase"])
    scene.render.resolution_x = 123
    assert addon.steps.put_objects_in(scene) == objects
    assert {each.name for each in objects.objects} == {"lamp"} and objects.render.resolution_x == 123
    tree = addon.compat.compositing_tree(scene)
    assert [each.name for each in tree.nodes if each.bl_idname == "CompositorNodeZcombine"] == ["KaRF Over Scene"]


def test_the_nearer_one_is_rendered(addon, scene):
    addon.steps.put_objects_in(scene)
    node = addon.compat.compositing_tree(scene).nodes["KaRF Over Scene"]
    sources = [(link.from_node.scene, link.from_socket.name) for each in node.inputs for link in each.links]
    objects = sources[0][0]
    assert sources == [(objects, "Image"), (objects, "Depth"), (scene, "Image"), (scene, "Depth")]
    assert addon.compat.compositing_output(node.id_data).links[0].from_node == node


def test_a_scene_without_a_capture_is_refused(bpy, addon, scene):
    other = bpy.data.scenes.new("other")
    with pytest.raises(addon.engine_api.BadRequest, match="no captured cameras"):
        addon.steps.put_objects_in(other)
