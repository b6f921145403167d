"""F12 with the render engine KaRF: pictures of the current swatches, passes and errors."""

from types import SimpleNamespace

import numpy as np
import pytest

WIDTH, HEIGHT = 40, 20


@pytest.fixture
def scene(bpy, learned):
    render = learned.render
    render.engine, render.resolution_x, render.resolution_y = "KARF", WIDTH, HEIGHT
    learned.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    return learned


@pytest.fixture
def render(bpy, addon, scene, monkeypatch):
    """A function that renders and returns Blender's passes, [H, W, channels], top row first."""
    passes, put = {}, addon.still._put

    def record(target, pixels):
        put(target, pixels)
        passes[target.name] = np.array(target.rect).reshape(pixels.shape)[::-1]

    def render():
        passes.clear()
        bpy.ops.render.render()
        return dict(passes)

    monkeypatch.setattr(addon.still, "_put", record)
    return render


@pytest.fixture
def queries(addon, monkeypatch):
    """The options and answers of all queries, to whose options `more` is added."""
    seen = SimpleNamespace(options=[], answers=[], more={})
    of, ask = addon.camera_pixels.options_of, addon.still.ask

    def options_of(*given):
        seen.options.append(of(*given) | seen.more)
        return seen.options[-1]

    def asking(*given):
        seen.answers.append(ask(*given))
        return seen.answers[-1]

    monkeypatch.setattr(addon.camera_pixels, "options_of", options_of)
    monkeypatch.setattr(addon.still, "ask", asking)
    return seen


@pytest.mark.parametrize("color", [(0.2, 0.4, 0.8), None])
def test_picture_is_upright_in_edited_or_learned_colors(addon, scene, render, color):
    if color is None:
        scene.karf.objects.clear()  # before palettes are learned
    else:
        addon.steps.set_swatch(scene, "pot", 1, color)
    combined = render()["Combined"]
    rows = np.linspace(1, 0.5, HEIGHT)[:, None] * np.array(color or (1, 1, 1))
    np.testing.assert_allclose(combined[:, 0, :3], addon.engine_api.srgb_to_linear(rows), atol=1e-4)
    assert (combined[..., 3] == 1).all()


def test_animation_follows_keyframed_colors_and_surfaces(bpy, addon, scene, queries):
    pot, lid = (addon.edits.swatch_at(scene, name, 1) for name in ("pot", "lid"))
    for frame, red, saturation in ((1, 0.0, 1.0), (3, 1.0, 0.0)):
        pot.color, lid.saturation = (red, 0, 0), saturation
        pot.keyframe_insert("color", frame=frame)
        lid.keyframe_insert("saturation", frame=frame)
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 3, f"{addon.folders.project_of(scene).folder}/film_"
    bpy.ops.render.render(animation=True)
    edits = [options["edit"]["objects"] for options in queries.options]
    np.testing.assert_allclose([edit["pot"]["colors"][1][0] for edit in edits], [0, 0.5, 1], atol=0.01)
    first, middle, last = (np.ptp(edit["lid"]["colors"][1]) for edit in edits)
    assert first == pytest.approx(0.4) and first > middle + 0.1 and middle > last + 0.1 and last < 0.03


def test_transparent_film_has_alpha(scene, render):
    scene.render.film_transparent = True
    combined = render()["Combined"]
    assert (combined[: HEIGHT // 2, :, 3] == 1).all()
    assert not combined[HEIGHT // 2 :].any()  # premultiplied


def test_depth_is_in_blenders_units(addon, scene, render):
    scene.view_layers[0].use_pass_z = True
    far = np.linalg.norm(addon.lens.pinhole(scene, scene.camera).position)
    scene.karf.rig.scale *= 3
    depth = render()["Depth"][..., 0]
    size = scene.karf.rig.matrix_world.to_scale().x
    np.testing.assert_allclose(depth[: HEIGHT // 2], far * size, rtol=1e-5)
    assert (depth[HEIGHT // 2 :] == 1e10).all()


def test_cryptomatte_and_weights_are_passes(scene, render):
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth, layer.karf.use_weights = True, 4, True
    passes = render()
    assert {"CryptoObject00", "CryptoObject01", "lid 1", "lid 2", "pot 1", "pot 2"} < set(passes)
    np.testing.assert_allclose(passes["CryptoObject00"][5, 5], [0.5, 1, 0, 0])
    assert not passes["CryptoObject01"].any()  # the engine writes one level
    for index, share in ((1, 0.25), (2, 0.125)):
        np.testing.assert_allclose(passes[f"pot {index}"], share)


@pytest.mark.parametrize("fades, seen", [(True, 0.75), (False, 0.25)])
def test_visibility_is_a_pass_and_fading_reaches_the_engine(scene, render, fades, seen):
    scene.view_layers[0].karf.use_seen, scene.karf.fade_unseen = True, fades
    assert (render()["Seen"] == seen).all()


def test_border_renders_only_its_part(addon, scene, render):
    assert render()["Combined"].shape == (HEIGHT, WIDTH, 4)
    settings = scene.render
    settings.use_border = settings.use_crop_to_border = True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0.5, 1
    assert render()["Combined"].shape == (HEIGHT // 2, WIDTH // 2, 4)
    camera = addon.lens.pinhole(scene, scene.camera)
    part = addon.still._bordered(scene, camera)
    point = camera.position[None] - 3 * camera.camera_to_world[:3, 2]
    (u, v), (x, y) = camera.project(point)[0][0], part.project(point)[0][0]
    assert (x, y) == pytest.approx((u - WIDTH / 4, v))


def test_one_process_renders_all_frames_and_removes_its_files(addon, scene, render, queries):
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        render()
    (folder,) = {addon.folders.Path(each["pixels"]).parents[1] for each in queries.answers}
    assert not list(folder.glob("answers/*"))
    addon.session.get(addon.still.RenderWorker).close()
    assert not folder.exists()


def test_cancelled_render_ends_the_worker(addon, scene, queries):
    queries.more = {"behave": "busy"}
    cancelled = iter([False] * 3 + [True])
    engine = SimpleNamespace(update_stats=lambda *_: None, test_break=lambda: next(cancelled))
    with pytest.raises(addon.engine_api.Cancelled):
        addon.still.render(engine, scene.view_layers[0].depsgraph)
    assert addon.session.get(addon.still.RenderWorker).worker is None


@pytest.mark.parametrize(
    ("trouble", "sentence"),
    [
        ("refuse", "photo_7.png is missing"),
        ("crash", "crashed"),
        ("idle", "exited before it answered"),
        ("orthographic camera", "not a perspective camera"),
        ("no project", "no KaRF project"),
    ],
)
def test_render_errors_are_reported(scene, render, queries, trouble, sentence):
    queries.more = {"behave": trouble}
    if trouble == "orthographic camera":
        scene.camera.data.type = "ORTHO"
    elif trouble == "no project":
        scene.karf.project = ""
    with pytest.raises(RuntimeError, match=sentence):
        render()


def test_blenders_panels_are_shown_only_while_enabled(bpy, addon):
    def known():
        panels = bpy.types.Panel.__subclasses__()
        return {each.__name__ for each in panels if "KARF" in getattr(each, "COMPAT_ENGINES", ())}

    assert {"RENDER_PT_format", "RENDER_PT_output", "DATA_PT_lens", "KARF_PT_passes"} <= known()
    addon.extension.unregister()
    while_disabled = known()
    addon.extension.register()
    assert while_disabled == {"KARF_PT_passes"}


@pytest.fixture
def own_objects(bpy, scene):
    """The scene with an object and a lamp of the artist, rendered by Cycles."""
    scene.render.engine = "CYCLES"
    for data in (bpy.data.meshes.new("vase"), bpy.data.lights.new("lamp", "SUN")):
        scene.collection.objects.link(bpy.data.objects.new(data.name, data))
    return scene


def test_over_scene_renders_the_nearer_of_scene_and_objects(addon, own_objects):
    objects = addon.steps.put_objects_in(own_objects)
    assert {each.name for each in objects.objects} == {"vase", "lamp"}
    assert (own_objects.render.engine, objects.render.engine) == ("KARF", "CYCLES")
    assert objects.render.film_transparent and objects.camera == own_objects.camera
    node = addon.compat.compositing_tree(own_objects).nodes["KaRF Over Scene"]
    sources = [(link.from_node.scene, link.from_socket.name) for each in node.inputs for link in each.links]
    assert sources == [(each, name) for each in (objects, own_objects) for name in ("Image", "Depth")]
    assert addon.compat.compositing_output(node.id_data).links[0].from_node == node


def test_over_scene_again_updates_its_scene(bpy, addon, own_objects):
    objects = addon.steps.put_objects_in(own_objects)
    bpy.data.objects.remove(bpy.data.objects["vase"])
    own_objects.render.resolution_x = 123
    assert addon.steps.put_objects_in(own_objects) == objects
    assert {each.name for each in objects.objects} == {"lamp"} and objects.render.resolution_x == 123
    tree = addon.compat.compositing_tree(own_objects)
    assert [each.name for each in tree.nodes if each.bl_idname == "CompositorNodeZcombine"] == ["KaRF Over Scene"]


def test_over_scene_needs_a_capture(bpy, addon, scene):
    with pytest.raises(addon.engine_api.BadRequest, match="no captured cameras"):
        addon.steps.put_objects_in(bpy.data.scenes.new("other"))
