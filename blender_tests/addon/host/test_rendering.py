"""The picture is not touched while Blender renders and follows the swatches afterwards."""

import numpy as np
import pytest


@pytest.fixture
def film(bpy, learned, tmp_path):
    """The scene with three frames of a keyframed swatch, and a render engine that does nothing."""

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
def shown(addon, film):
    """A function that returns the picture, 8 bit."""
    return lambda: np.rint(addon.images.pixels(film.karf.result)[..., :3] * 255).astype(int)


@pytest.fixture
def while_rendering(bpy):
    """A list of functions to call at every rendered frame."""
    calls = []

    def call(*_):
        for each in calls:
            each()

    bpy.app.handlers.render_pre.append(call)
    yield calls
    bpy.app.handlers.render_pre.remove(call)


def test_no_pixels_are_written_during_an_animation(bpy, addon, film, shown, while_rendering, monkeypatch):
    uploads, at_frames, upload = [], [], addon.images.upload
    monkeypatch.setattr(addon.images, "upload", lambda image, buffer: (uploads.append(1), upload(image, buffer)))
    while_rendering.append(lambda: at_frames.append(len(uploads)))
    bpy.ops.render.render(animation=True)
    assert at_frames == [0, 0, 0]
    before = shown()
    film.frame_set(3)
    assert uploads and np.abs(shown() - before).max() > 10


def test_swatch_changed_while_rendering_is_followed_afterwards(bpy, film, shown, while_rendering):
    before, pictures = shown(), []
    while_rendering.append(lambda: setattr(film.karf.objects["lid"].swatches[1], "color", (0, 0, 0)))
    while_rendering.append(lambda: pictures.append(shown()))
    bpy.ops.render.render()
    assert len(pictures) == 1 and np.array_equal(pictures[0], before)
    assert np.abs(shown() - before).max() > 10


def test_show_view_is_rejected_while_rendering(bpy, addon, film, while_rendering):
    sentences = []

    def show():
        with pytest.raises(addon.engine_api.BadRequest) as caught:
            addon.steps.show_view(film).wait()
        sentences.append(caught.value.sentence)

    while_rendering.append(show)
    bpy.ops.render.render()
    assert sentences == ["Blender is rendering."]


def test_picture_follows_swatches_after_a_failed_render(bpy, addon, film, shown):
    film.camera, before = None, shown()
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.render.render()
    addon.steps.set_swatch(film, "lid", 1, "#00ff00")
    assert np.abs(shown() - before).max() > 10
