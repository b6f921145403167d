"""The compositor: mattes that Blender's own node reads, and nodes that recompose what the engine recolors."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

NAMES = ("lid", "pot")


@pytest.fixture
def truth(layers_file):
    with np.load(layers_file.parents[1] / "truth.npz") as arrays:
        return dict(arrays)


@pytest.fixture
def compositor(bpy, addon, scene):
    """The scene's compositing nodes, with no 3D scene to render."""
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 40, 30, 100
    scene.view_settings.view_transform = "Standard"
    return addon.compat.compositing_tree(scene)


def rendered(bpy, addon, scene, folder):
    """What the compositor gives, scene-linear [30, 40, 3], top row first."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(folder / "rendered.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = addon.images.pixels(image)[..., :3].copy()
    bpy.data.images.remove(image)
    return pixels


def as_display(addon, light):
    return np.clip(addon.engine_api.linear_to_srgb(light), 0, 1)


def set_edit(addon, scene, truth):
    for name, colors in zip(NAMES, truth["edited"], strict=True):
        for index in (1, 2):
            addon.steps.set_swatch(scene, name, index, colors[index])


def set_sockets(addon, node, truth):
    for name, colors in zip(NAMES, truth["edited"], strict=True):
        for index in (1, 2):
            node.inputs[f"{name} {index}"].default_value = (*addon.engine_api.srgb_to_linear(colors[index]), 1)


@pytest.mark.parametrize("which, name", list(enumerate(NAMES)))
def test_blenders_cryptomatte_node_gives_an_objects_coverage(
    bpy, addon, scene, compositor, layers_file, truth, tmp_path, which, name
):
    node = compositor.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.image = "IMAGE", bpy.data.images.load(str(layers_file))
    assert node.layer_name == "CryptoObject"
    node.matte_id = name
    compositor.links.new(node.outputs["Matte"], addon.compat.compositing_output(compositor))
    matte = rendered(bpy, addon, scene, tmp_path)[..., 0]
    np.testing.assert_allclose(matte, truth["coverage"][which], atol=1e-6)


def test_the_nodes_recompose_the_engines_picture(bpy, addon, scene, compositor, layers_file, truth, tmp_path):
    """From the file alone: the scene knows nothing of its objects."""
    node = addon.steps.place_layers(scene, layers_file)
    set_sockets(addon, node, truth)
    picture = as_display(addon, rendered(bpy, addon, scene, tmp_path))
    assert np.abs(picture - truth["recolored"]).max() < 0.5 / 255


def test_layers_of_a_photo_that_is_exposed_otherwise_show_the_edit_as_it_would(
    bpy, addon, scene, compositor, layers_file, truth, tmp_path
):
    node = addon.steps.place_layers(scene, layers_file.with_name("exposed.exr"))
    set_sockets(addon, node, truth)
    picture = as_display(addon, rendered(bpy, addon, scene, tmp_path))
    assert np.abs(picture - truth["exposed"]).max() < 0.5 / 255


def test_layers_in_another_color_space_recompose_the_same_picture(
    bpy, addon, scene, compositor, layers_file, truth, tmp_path
):
    path = layers_file.with_name("acescg.exr")
    if not path.exists():
        pytest.skip("the engine has no OpenColorIO")
    scene.karf.layer_space = "ACEScg"
    node = addon.steps.place_layers(scene, path)
    set_sockets(addon, node, truth)
    picture = as_display(addon, rendered(bpy, addon, scene, tmp_path))
    assert np.abs(picture - truth["recolored"]).max() < 0.5 / 255


def test_a_space_that_blender_does_not_know_is_said(bpy, addon, scene, compositor, layers_file):
    scene.karf.layer_space = "studio log"
    addon.steps.place_layers(scene, layers_file)
    assert "Blender does not know the color space studio log" in addon.progress.state().warnings


def test_the_engine_is_asked_for_the_chosen_spaces(bpy, addon, learned, tmp_path):
    learned.karf.layer_space, learned.karf.photo_space, learned.karf.ocio = "ACEScg", "ACEScct", "/show/config.ocio"
    (request,) = addon.steps.build_compositor(learned).requests
    options = request.options
    assert (options["layer_space"], options["ocio"]) == ("ACEScg", "/show/config.ocio")
    options = addon.steps.learn_scene(learned).requests[0].options
    assert (options["photo_space"], options["ocio"]) == ("ACEScct", "/show/config.ocio")


def test_nodes_that_change_nothing_give_the_base(bpy, addon, scene, compositor, layers_file, tmp_path):
    node = addon.steps.place_layers(scene, layers_file)
    ours = rendered(bpy, addon, scene, tmp_path)
    compositor.links.new(node.inputs["Image"].links[0].from_socket, addon.compat.compositing_output(compositor))
    base = rendered(bpy, addon, scene, tmp_path)
    assert np.abs(as_display(addon, ours) - as_display(addon, base)).max() < 0.1 / 255


@pytest.fixture
def built(bpy, addon, learned, compositor, layers_file, monkeypatch):
    """The node that recolors the active view, of a scene with swatches."""
    monkeypatch.setenv("FAKE_LAYERS", str(layers_file))
    return addon.steps.build_compositor(learned).wait()


@pytest.mark.parametrize("driven", [True, False])
def test_a_changed_swatch_changes_the_rendered_picture_where_sockets_follow(
    bpy, addon, learned, built, truth, tmp_path, driven
):
    bpy.ops.karf.build_compositor(driven=driven)
    before = as_display(addon, rendered(bpy, addon, learned, tmp_path))
    set_edit(addon, learned, truth)
    after = as_display(addon, rendered(bpy, addon, learned, tmp_path))
    expected = truth["recolored"] if driven else before
    assert np.abs(before - truth["recolored"]).max() > 0.1
    assert np.abs(after - expected).max() < 0.5 / 255


def test_keyframed_swatches_are_followed(bpy, addon, learned, built, truth, tmp_path):
    addon.steps.build_compositor(learned, driven=True).wait()
    swatch = learned.karf.objects["pot"].swatches[1]
    swatch.keyframe_insert("color", frame=1)
    set_edit(addon, learned, truth)
    swatch.keyframe_insert("color", frame=3)
    learned.frame_set(3)
    last = as_display(addon, rendered(bpy, addon, learned, tmp_path))
    assert np.abs(last - truth["recolored"]).max() < 0.5 / 255


def test_built_anew_sockets_stand_where_the_swatches_do(bpy, addon, learned, built, truth):
    addon.steps.build_compositor(learned, driven=True).wait()
    set_edit(addon, learned, truth)
    addon.steps.build_compositor(learned).wait()
    assert not built.id_data.animation_data.drivers
    value = addon.engine_api.linear_to_srgb(built.inputs["pot 1"].default_value[:3])
    np.testing.assert_allclose(value, truth["edited"][1, 1], atol=1e-5)


OPENED_BY_ANOTHER = """
import os, sys, bpy
blend, out = sys.argv[-2:]
bpy.ops.wm.open_mainfile(filepath=blend)
assert not hasattr(bpy.types.Scene, "karf")
bpy.context.scene.render.filepath = out
bpy.ops.render.render(write_still=True)
os._exit(0)
"""


@pytest.mark.parametrize("driven", [True, False])
def test_a_saved_file_recolors_without_the_extension(bpy, addon, learned, built, truth, tmp_path, driven):
    addon.steps.build_compositor(learned, driven=True).wait()
    set_edit(addon, learned, truth)
    if not driven:
        addon.steps.build_compositor(learned).wait()
    rendered(bpy, addon, learned, tmp_path)  # sets the output's format
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "recolor.blend"))
    out = tmp_path / "opened.exr"
    command = [sys.executable, "-c", OPENED_BY_ANOTHER, str(tmp_path / "recolor.blend"), str(out)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    image = bpy.data.images.load(str(out))
    picture = as_display(addon, addon.images.pixels(image)[..., :3])
    assert np.abs(picture - truth["recolored"]).max() < 0.5 / 255


def test_the_nodes_are_of_blenders_own_types(bpy, built):
    trees = [built.id_data, built.node_tree]
    types = {node.bl_idname for tree in trees for node in tree.nodes}
    assert types and all(getattr(bpy.types, name).__module__ == "bpy.types" for name in types)


def test_what_others_have_linked_stays(bpy, addon, learned, compositor, layers_file, monkeypatch):
    monkeypatch.setenv("FAKE_LAYERS", str(layers_file))
    own, output = compositor.nodes.new("CompositorNodeRGB"), addon.compat.compositing_output(compositor)
    compositor.links.new(own.outputs[0], output)
    node = addon.steps.build_compositor(learned).wait()
    assert output.links[0].from_node == own
    assert [link.to_node.bl_idname for link in node.outputs[0].links] == ["CompositorNodeViewer"]
    assert "link KaRF photo_0 where you want it" in addon.progress.state().warnings


def test_what_makes_the_rendered_picture_another_is_said(bpy, addon, learned, built):
    assert not addon.progress.state().warnings.count("pixels, but the scene renders")
    learned.render.resolution_x, learned.view_settings.view_transform = 80, "AgX"
    addon.steps.build_compositor(learned).wait()
    warnings = addon.progress.state().warnings
    assert "The layers have 40 x 30 pixels, but the scene renders 80 x 30." in warnings
    assert "The view transform AgX changes colors" in warnings


def test_built_again_it_is_the_same_node_with_the_same_links(bpy, addon, learned, compositor, built):
    blur = compositor.nodes.new("CompositorNodeBlur")
    output = addon.compat.compositing_output(compositor)
    compositor.links.new(built.outputs[0], blur.inputs[0])
    compositor.links.new(blur.outputs[0], output)
    count = len(compositor.nodes), len(bpy.data.node_groups), len(bpy.data.images)
    again = addon.steps.build_compositor(learned).wait()
    assert again == built and output.links[0].from_node == blur
    assert {link.to_node.bl_idname for link in again.outputs[0].links} == {"CompositorNodeBlur", "CompositorNodeViewer"}
    assert (len(compositor.nodes), len(bpy.data.node_groups), len(bpy.data.images)) == count


def test_names_that_blender_would_cut_stay_apart(bpy, addon, compositor, layers_file, tmp_path):
    views = ["very " * 15 + end for end in ("long", "lengthy")]
    for view in views:
        shutil.copy(layers_file, tmp_path / f"{view}.exr")
    nodes = [addon.steps.place_layers(bpy.context.scene, tmp_path / f"{view}.exr") for view in views]
    again = [addon.steps.place_layers(bpy.context.scene, tmp_path / f"{view}.exr") for view in views]
    assert nodes == again and nodes[0] != nodes[1]


def test_layers_of_other_palettes_do_not_follow_the_swatches(bpy, addon, learned, compositor, layers_file):
    learned.karf.objects["pot"].swatches[1].learned = (0.1, 0.1, 0.1)
    node = addon.steps.place_layers(learned, layers_file, driven=True)
    driven = {curve.data_path for curve in node.id_data.animation_data.drivers}
    numbers = {socket.name: number for number, socket in enumerate(node.inputs)}
    assert driven == {f'nodes["{node.name}"].inputs[{numbers[name]}].default_value' for name in ("lid 1", "lid 2")}
    assert "The swatches of pot belong to other palettes" in addon.progress.state().warnings


def test_a_picture_without_layers_is_refused(bpy, addon, learned, tmp_path):
    (tmp_path / "none.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(20))
    with pytest.raises(addon.engine_api.DataError, match="holds no layers of KaRF"):
        addon.steps.place_layers(learned, tmp_path / "none.exr")


def test_objects_of_long_names_have_sockets_of_their_own(bpy, addon, compositor):
    colors, names = np.zeros((2, 3)), ["鍋" * 60 + end for end in "ab"]
    layers = [addon.engine_api.ObjectLayers(n, f"{n[-1]}_all", (f"{n[-1]}_0", f"{n[-1]}_1"), colors) for n in names]
    tree = bpy.data.node_groups.new("long", "CompositorNodeTree")
    addon.compositor.fill(tree, layers)
    node = compositor.nodes.new("CompositorNodeGroup")
    node.node_tree = tree
    sockets = [node.inputs[addon.nodes.swatch_socket(name, 1)] for name in names]
    assert len({socket.identifier for socket in sockets}) == 2
