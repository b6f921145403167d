"""F12 with the render engine KaRF: the engine's pixels with the swatches as they stand, passes beside them, errors said."""

from types import SimpleNamespace

import numpy as np
import pytest

SHARES = (0.125, 0.25, 0.125)  # of the fake engine's palette entries
WIDTH, HEIGHT = 40, 20


@pytest.fixture
def scene(bpy, learned):
    render = learned.render
    render.engine, render.resolution_x, render.resolution_y = "KARF", WIDTH, HEIGHT
    learned.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    return learned


@pytest.fixture
def render(bpy, addon, scene, monkeypatch):
    """Renders, and gives what Blender holds of each pass, [H, W, channels] with the highest row first."""
    handed, size = {}, {}
    put, bordered = addon.still._put, addon.still._bordered

    def putting(target, pixels):
        put(target, pixels)
        handed[target.name] = np.array(target.rect).reshape(*size["still"], -1)[::-1]

    def remembering(*given):
        camera = bordered(*given)
        size["still"] = camera.height, camera.width
        return camera

    monkeypatch.setattr(addon.still, "_put", putting)
    monkeypatch.setattr(addon.still, "_bordered", remembering)

    def run():
        handed.clear()
        bpy.ops.render.render()
        return dict(handed)

    return run


def options_are(addon, monkeypatch, **more):
    """Let each query say this too."""
    of = addon.camera_pixels.options_of
    monkeypatch.setattr(addon.camera_pixels, "options_of", lambda *given: of(*given) | more)


def test_the_picture_has_the_swatches_colors_and_stands_upright(addon, scene, render):
    addon.steps.set_swatch(scene, "pot", 1, (0.2, 0.4, 0.8))
    combined = render()["Combined"]
    rows = np.linspace(1, 0.5, HEIGHT)[:, None] * np.array([0.2, 0.4, 0.8])
    np.testing.assert_allclose(combined[:, 0, :3], addon.engine_api.srgb_to_linear(rows), atol=1e-4)
    assert (combined[..., 3] == 1).all()


def test_before_palettes_are_learned_it_is_the_scene_as_learned(addon, scene, render):
    scene.karf.objects.clear()
    np.testing.assert_allclose(render()["Combined"][0, 0, :3], 1, atol=1e-6)


def test_keyframed_swatches_are_those_of_the_frame(bpy, addon, scene, render):
    swatch = addon.edits.swatch_at(scene, "pot", 1)
    for frame, red in ((1, 0.0), (11, 1.0)):
        swatch.color = red, 0.0, 0.0
        swatch.keyframe_insert("color", frame=frame)
    reds = []
    for frame in (1, 6, 11):
        scene.frame_set(frame)
        reds.append(addon.engine_api.linear_to_srgb(render()["Combined"][0, 0, :3])[0])
    np.testing.assert_allclose(reds, [0, 0.5, 1], atol=0.01)


def test_keyframed_surfaces_are_those_of_the_frame_also_in_an_animation(bpy, addon, scene, render, monkeypatch):
    swatch, asked, of = addon.edits.swatch_at(scene, "pot", 1), [], addon.camera_pixels.options_of
    for frame, saturation in ((1, 1.0), (3, 0.0)):
        swatch.saturation = saturation
        swatch.keyframe_insert("saturation", frame=frame)
    monkeypatch.setattr(
        addon.camera_pixels, "options_of", lambda *given: asked.append(of(*given)["edit"]) or of(*given)
    )
    scene.frame_start, scene.frame_end, scene.render.filepath = 1, 3, f"{addon.folders.project_of(scene).folder}/film_"
    bpy.ops.render.render(animation=True)
    first, middle, last = (np.ptp(edit["objects"]["pot"]["colors"][1]) for edit in asked)
    assert first == pytest.approx(0.7) and first > middle + 0.1 and middle > last + 0.1 and last < 0.03


def test_a_transparent_film_has_alpha(scene, render):
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


def test_cryptomatte_and_weights_are_passes(addon, scene, render):
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object, layer.pass_cryptomatte_depth, layer.karf.use_weights = True, 4, True
    passes = render()
    assert {"CryptoObject00", "CryptoObject01", "lid 1", "lid 2", "pot 1", "pot 2"} < set(passes)
    np.testing.assert_allclose(passes["CryptoObject00"][5, 5], [0.5, 1, 0, 0])
    assert not passes["CryptoObject01"].any()  # the engine has one level
    for index in (1, 2):
        np.testing.assert_allclose(passes[f"pot {index}"], SHARES[index])


@pytest.mark.parametrize("fades, seen", [(True, 0.75), (False, 0.25)])
def test_how_well_photos_know_it_is_a_pass_and_the_checkbox_reaches_the_engine(addon, scene, render, fades, seen):
    scene.view_layers[0].karf.use_seen, scene.karf.fade_unseen = True, fades
    assert (render()["Seen"] == seen).all()


def test_a_border_renders_that_part_of_the_picture(scene, render):
    whole = render()["Combined"]
    settings = scene.render
    settings.use_border = settings.use_crop_to_border = True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0.5, 1
    part = render()["Combined"]
    assert part.shape == (HEIGHT // 2, WIDTH // 2, 4) and whole.shape == (HEIGHT, WIDTH, 4)


def test_the_camera_of_a_border_sees_what_the_whole_one_sees_there(addon, scene):
    settings = scene.render
    settings.use_border = True
    settings.border_min_x, settings.border_max_x, settings.border_min_y, settings.border_max_y = 0.25, 0.75, 0.5, 1
    camera = addon.lens.pinhole(scene, scene.camera)
    part = addon.still._bordered(scene, camera)
    point = camera.position[None] - 3 * camera.camera_to_world[:3, 2]
    (u, v), (x, y) = camera.project(point)[0][0], part.project(point)[0][0]
    assert (x, y) == pytest.approx((u - WIDTH / 4, v))


def test_one_process_renders_an_animation_and_its_files_go(addon, scene, render, monkeypatch):
    answers = []
    ask = addon.still.ask
    monkeypatch.setattr(addon.still, "ask", lambda *given: answers.append(ask(*given)) or answers[-1])
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        render()
    folders = {addon.folders.Path(each["pixels"]).parents[1] for each in answers}
    assert len(folders) == 1  # the job's folder of one worker
    assert not list(folders.pop().glob("answers/*"))
    addon.session.get(addon.still.RenderWorker).close()
    assert not any(each.exists() for each in folders)


def test_a_cancelled_render_ends_the_worker(addon, scene, monkeypatch):
    options_are(addon, monkeypatch, behave="busy")
    cancelled = iter([False] * 3 + [True])
    engine = SimpleNamespace(update_stats=lambda *_: None, test_break=lambda: next(cancelled))
    depsgraph = scene.view_layers[0].depsgraph
    with pytest.raises(addon.engine_api.Cancelled):
        addon.still.render(engine, depsgraph)
    assert addon.session.get(addon.still.RenderWorker).worker is None


@pytest.mark.parametrize(
    ("behave", "sentence"),
    [("refuse", "photo_7.png is missing"), ("crash", "crashed"), ("idle", "exited before it answered")],
)
def test_what_the_engine_cannot_do_is_said(addon, scene, render, monkeypatch, behave, sentence):
    options_are(addon, monkeypatch, behave=behave)
    with pytest.raises(RuntimeError, match=sentence):
        render()


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda scene: setattr(scene.camera.data, "type", "ORTHO"), "not a perspective camera"),
        (lambda scene: setattr(scene.karf, "project", ""), "no KaRF project"),
    ],
)
def test_what_cannot_be_rendered_is_said(scene, render, spoil, sentence):
    spoil(scene)
    with pytest.raises(RuntimeError, match=sentence):
        render()


def test_blenders_panels_are_there_while_the_extension_is_enabled(bpy, addon):
    def known():
        return {
            each.__name__ for each in bpy.types.Panel.__subclasses__() if "KARF" in getattr(each, "COMPAT_ENGINES", ())
        }

    assert {"RENDER_PT_format", "RENDER_PT_output", "DATA_PT_lens", "KARF_PT_passes"} <= known()
    addon.extension.unregister()
    try:
        assert known() == {"KARF_PT_passes"}
    finally:
        addon.extension.register()
