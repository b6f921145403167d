"""The compositor: Blender's own node reads the mattes, and KaRF's nodes recolor as the engine does."""

import shutil

import numpy as np
import pytest

from ..conftest import run_without_extension

NAMES = ("lid", "pot")
LEVEL = 1 / 255


@pytest.fixture
def truth(layers_file):
    """The engine's `coverage`, `edited` colors, and pictures `recolored` and `exposed`."""
    with np.load(layers_file.parents[1] / "truth.npz") as arrays:
        return dict(arrays)


@pytest.fixture
def compositor(addon, scene):
    """The compositing nodes of a scene that renders 40 x 30 pixels."""
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 40, 30, 100
    scene.view_settings.view_transform = "Standard"
    return addon.compat.compositing_tree(scene)


def load(bpy, addon, path):
    """A scene-linear picture, [30, 40, 3], top row first."""
    image = bpy.data.images.load(str(path))
    pixels = addon.images.pixels(image)[..., :3].copy()
    bpy.data.images.remove(image)
    return pixels


def as_display(addon, light):
    return np.clip(addon.engine_api.linear_to_srgb(light), 0, 1)


@pytest.fixture
def composite(bpy, addon, scene, compositor, tmp_path):
    """A function that renders and returns the compositor's picture, as displayed or scene-linear."""

    def composite(is_displayed=True):
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
        scene.render.filepath = str(tmp_path / "rendered.exr")
        bpy.ops.render.render(write_still=True)
        pixels = load(bpy, addon, scene.render.filepath)
        return as_display(addon, pixels) if is_displayed else pixels

    return composite


@pytest.fixture
def set_edit(addon, scene, truth):
    """A function that gives the swatches the edited colors."""

    def set_edit():
        for name, colors in zip(NAMES, truth["edited"], strict=True):
            for index in (1, 2):
                addon.steps.set_swatch(scene, name, index, colors[index])

    return set_edit


@pytest.fixture
def built(addon, learned, compositor, layers_file, monkeypatch):
    """The node that recolors the active view of a scene with swatches."""
    monkeypatch.setenv("FAKE_LAYERS", str(layers_file))
    return addon.steps.build_compositor(learned).wait()


@pytest.mark.parametrize("which, name", list(enumerate(NAMES)))
def test_cryptomatte_node_gives_object_coverage(bpy, addon, compositor, composite, layers_file, truth, which, name):
    node = compositor.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.image = "IMAGE", bpy.data.images.load(str(layers_file))
    assert node.layer_name == "CryptoObject"
    node.matte_id = name
    compositor.links.new(node.outputs["Matte"], addon.compat.compositing_output(compositor))
    np.testing.assert_allclose(composite(is_displayed=False)[..., 0], truth["coverage"][which], atol=1e-6)


@pytest.mark.parametrize(
    ("file", "space", "expected"),
    [
        ("photo_0.exr", "", "recolored"),
        ("exposed.exr", "", "exposed"),  # of a photo with another exposure
        ("acescg.exr", "ACEScg", "recolored"),
    ],
)
def test_nodes_recolor_as_the_engine_does(addon, scene, composite, layers_file, truth, file, space, expected):
    if not layers_file.with_name(file).exists():
        pytest.skip("the engine has no OpenColorIO")
    scene.karf.layer_space = space
    node = addon.steps.place_layers(scene, layers_file.with_name(file))
    for name, colors in zip(NAMES, truth["edited"], strict=True):
        for index in (1, 2):
            light = addon.engine_api.srgb_to_linear(colors[index])
            node.inputs[f"{name} {index}"].default_value = (*light, 1)
    assert np.abs(composite() - truth[expected]).max() < 0.5 * LEVEL


def test_unedited_nodes_give_the_base_picture(addon, scene, compositor, composite, layers_file):
    node = addon.steps.place_layers(scene, layers_file)
    ours = composite()
    compositor.links.new(node.inputs["Image"].links[0].from_socket, addon.compat.compositing_output(compositor))
    assert np.abs(ours - composite()).max() < 0.1 * LEVEL


def test_sockets_without_drivers_do_not_follow_swatches(built, composite, set_edit, truth):
    before = composite()
    set_edit()
    assert np.array_equal(composite(), before) and np.abs(before - truth["recolored"]).max() > 0.1


def test_keyframed_swatches_are_followed(addon, learned, built, composite, set_edit, truth):
    addon.steps.build_compositor(learned, driven=True).wait()
    swatch = learned.karf.objects["pot"].swatches[1]
    swatch.keyframe_insert("color", frame=1)
    set_edit()
    swatch.keyframe_insert("color", frame=3)
    learned.frame_set(3)
    assert np.abs(composite() - truth["recolored"]).max() < 0.5 * LEVEL


@pytest.mark.parametrize("driven", [True, False])
def test_file_recolors_without_the_extension(bpy, addon, learned, built, composite, set_edit, truth, tmp_path, driven):
    assert bpy.ops.karf.build_compositor(driven=True) == {"FINISHED"}
    set_edit()
    if not driven:  # the sockets keep the swatches' colors
        addon.steps.build_compositor(learned).wait()
        assert not built.id_data.animation_data.drivers
    composite()  # sets the output format
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "recolor.blend"))
    render = "bpy.context.scene.render.filepath = out; bpy.ops.render.render(write_still=True)"
    run_without_extension(render, tmp_path / "recolor.blend", tmp_path / "opened.exr")
    picture = as_display(addon, load(bpy, addon, tmp_path / "opened.exr"))
    assert np.abs(picture - truth["recolored"]).max() < 0.5 * LEVEL


def test_chosen_color_spaces_reach_the_engine(addon, learned):
    learned.karf.layer_space, learned.karf.photo_space, learned.karf.ocio = "ACEScg", "ACEScct", "/show/config.ocio"
    options = addon.steps.build_compositor(learned).requests[0].options
    assert (options["layer_space"], options["ocio"]) == ("ACEScg", "/show/config.ocio")
    options = addon.steps.learn_scene(learned).requests[0].options
    assert (options["photo_space"], options["ocio"]) == ("ACEScct", "/show/config.ocio")


def test_existing_links_are_kept(addon, learned, compositor, layers_file):
    own, output = compositor.nodes.new("CompositorNodeRGB"), addon.compat.compositing_output(compositor)
    compositor.links.new(own.outputs[0], output)
    node = addon.steps.place_layers(learned, layers_file)
    assert output.links[0].from_node == own
    assert [link.to_node.bl_idname for link in node.outputs[0].links] == ["CompositorNodeViewer"]
    assert "link KaRF photo_0 where you want it" in addon.progress.state().warnings


def test_rebuilding_keeps_the_node_and_its_links(bpy, addon, learned, compositor, built):
    blur = compositor.nodes.new("CompositorNodeBlur")
    output = addon.compat.compositing_output(compositor)
    compositor.links.new(built.outputs[0], blur.inputs[0])
    compositor.links.new(blur.outputs[0], output)
    count = len(compositor.nodes), len(bpy.data.node_groups), len(bpy.data.images)
    again = addon.steps.build_compositor(learned).wait()
    assert again == built and output.links[0].from_node == blur
    assert {link.to_node.bl_idname for link in again.outputs[0].links} == {"CompositorNodeBlur", "CompositorNodeViewer"}
    assert (len(compositor.nodes), len(bpy.data.node_groups), len(bpy.data.images)) == count


def test_unsuitable_render_settings_are_warned_of(addon, scene, compositor, layers_file):
    addon.steps.place_layers(scene, layers_file)
    assert not addon.progress.state().warnings.count("pixels, but the scene renders")
    scene.render.resolution_x, scene.view_settings.view_transform = 80, "AgX"
    scene.karf.layer_space = "studio log"
    addon.steps.place_layers(scene, layers_file)
    for warning in (
        "The layers have 40 x 30 pixels, but the scene renders 80 x 30.",
        "The view transform AgX changes colors",
        "Blender does not know the color space studio log",
    ):
        assert warning in addon.progress.state().warnings


def test_layers_of_other_palettes_do_not_follow_swatches(addon, learned, compositor, layers_file):
    learned.karf.objects["pot"].swatches[1].learned = (0.1, 0.1, 0.1)
    node = addon.steps.place_layers(learned, layers_file, driven=True)
    driven = {curve.data_path for curve in node.id_data.animation_data.drivers}
    numbers = {socket.name: number for number, socket in enumerate(node.inputs)}
    assert driven == {f'nodes["{node.name}"].inputs[{numbers[name]}].default_value' for name in ("lid 1", "lid 2")}
    assert "The swatches of pot belong to other palettes" in addon.progress.state().warnings


def test_picture_without_layers_is_rejected(addon, learned, tmp_path):
    (tmp_path / "none.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(20))
    with pytest.raises(addon.engine_api.DataError, match="holds no layers of KaRF"):
        addon.steps.place_layers(learned, tmp_path / "none.exr")


def test_long_view_and_object_names_stay_distinct(bpy, addon, scene, compositor, layers_file, tmp_path):
    views = [tmp_path / f"{'very ' * 15}{end}.exr" for end in ("long", "lengthy")]
    for view in views:
        shutil.copy(layers_file, view)
    placed = [addon.steps.place_layers(scene, view) for view in (*views, *views)]
    assert placed[:2] == placed[2:] and placed[0] != placed[1]
    colors, names = np.zeros((2, 3)), ["鍋" * 60 + end for end in "ab"]
    layers = [addon.engine_api.ObjectLayers(n, f"{n[-1]}_all", (f"{n[-1]}_0", f"{n[-1]}_1"), colors) for n in names]
    node = compositor.nodes.new("CompositorNodeGroup")
    node.node_tree = bpy.data.node_groups.new("long", "CompositorNodeTree")
    addon.compositor.fill(node.node_tree, layers)
    sockets = [node.inputs[addon.nodes.swatch_socket(name, 1)] for name in names]
    assert len({socket.identifier for socket in sockets}) == 2
