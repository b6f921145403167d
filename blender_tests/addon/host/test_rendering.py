"""While Blender renders nothing touches pixels; afterwards the picture has followed."""

import numpy as np
import pytest


def shown(addon, scene):
    """The result image, 8 bit."""
    return np.rint(addon.images.pixels(scene.karf.result)[..., :3] * 255).astype(int)


@pytest.fixture
def film(bpy, addon, learned, tmp_path):
    """The scene with three frames of a keyframed swatch, and an engine that renders at once."""

    class Engine(bpy.types.RenderEngine):
        bl_idname, bl_label = "KARF_TEST", "Test"

        def render(self, depsgraph):
            pass

    bpy.utils.register_class(Engine)
    swatch = learned.karf.objects["pot"].swatches[1]
    for frame, color in ((1, (0.8, 0.2, 0.1)), (3, (0.0, 0.2, 0.1))):
        swatch.color = color
        swatch.keyframe_insert("color", frame=frame)
    learned.render.engine = "KARF_TEST"
    learned.render.resolution_x = learned.render.resolution_y = 16
    learned.render.filepath = str(tmp_path / "film" / "")
    learned.frame_start, learned.frame_end = 1, 3
    learned.frame_set(1)
    yield learned
    learned.render.engine = "BLENDER_WORKBENCH"
    bpy.utils.unregister_class(Engine)


@pytest.fixture
def while_rendering(bpy):
    """A list of what is to be called at every rendered frame."""
    calls = []

    def call(*_):
        for each in calls:
            each()

    bpy.app.handlers.render_pre.append(call)
    yield calls
    bpy.app.handlers.render_pre.remove(call)


def test_no_pixel_is_written_while_an_animation_is_rendered(bpy, addon, film, monkeypatch):
    uploads, rendering = [], []
    bpy.app.handlers.render_init.insert(0, lambda *_: rendering.append(True))
    bpy.app.handlers.render_complete.insert(0, lambda *_: rendering.clear())
    upload = addon.images.upload
    monkeypatch.setattr(
        addon.images, "upload", lambda image, buffer: (uploads.append(bool(rendering)), upload(image, buffer))
    )
    try:
        bpy.ops.render.render(animation=True)
    finally:
        del bpy.app.handlers.render_init[0], bpy.app.handlers.render_complete[0]
    assert not any(uploads)
    before = shown(addon, film)
    film.frame_set(3)
    assert uploads and np.abs(shown(addon, film) - before).max() > 10


def test_the_picture_follows_a_swatch_changed_while_rendering(bpy, addon, film, while_rendering):
    before = shown(addon, film)
    seen = []
    while_rendering.append(lambda: film.karf.objects["lid"].swatches[1].__setattr__("color", (0, 0, 0)))
    while_rendering.append(lambda: seen.append(shown(addon, film)))
    bpy.ops.render.render()
    assert all(np.array_equal(picture, before) for picture in seen)
    assert np.abs(shown(addon, film) - before).max() > 10


def test_showing_a_view_while_rendering_is_refused_in_a_sentence(bpy, addon, film, while_rendering):
    refused = []

    def show():
        try:
            addon.steps.show_view(film).wait()
        except addon.engine_api.BadRequest as error:
            refused.append(error.sentence)

    while_rendering.append(show)
    bpy.ops.render.render()
    assert refused == ["Blender is rendering."]


def test_a_cancelled_render_leaves_the_picture_following(bpy, addon, film):
    film.camera, before = None, shown(addon, film)
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.render.render()
    addon.steps.set_swatch(film, "lid", 1, "#00ff00")
    assert np.abs(shown(addon, film) - before).max() > 10


def test_disabling_in_the_middle_leaves_no_handler_and_no_timer(bpy, addon, film, while_rendering):
    names = [name for name in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, name), list)]
    before = {name: len(getattr(bpy.app.handlers, name)) for name in names}
    addon.extension.unregister()
    after = {name: len(getattr(bpy.app.handlers, name)) for name in names}
    ours = [h for name in names for h in getattr(bpy.app.handlers, name) if h.__module__ == addon.displayed.__name__]
    addon.extension.register()
    assert not ours and after != before
    assert {name: len(getattr(bpy.app.handlers, name)) for name in names} == before
    assert not bpy.app.timers.is_registered(addon.displayed._catch_up)
