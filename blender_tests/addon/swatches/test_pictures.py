"""Recolored pictures: exact pixels, views without planes, and several scenes."""

import numpy as np
import pytest

from ..prepared import write_current_planes
from .scenes import HEIGHT, RED, WIDTH, levels

BASE = (np.arange(HEIGHT * WIDTH * 3) % 256).reshape(HEIGHT, WIDTH, 3)  # the fake engine's photo, 8 bit


def assert_shows(addon, scene, change):
    """The picture is the photo with a change added to every pixel."""
    expected = np.clip(BASE / 255 + change, 0, 1) * 255
    assert np.abs(levels(addon, scene) - expected).max() <= 0.5 + 1e-2


def test_capture_is_learned_segmented_and_shown_exactly(addon, project_scene, tmp_path):
    assert addon.steps.learn_scene(project_scene, "demo", ["geometry.max_rays=64"]).wait()["psnr"] == 30
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", np.ones((HEIGHT, WIDTH, 3)))
    assert addon.steps.segment(project_scene, tmp_path / "given").wait()["objects"] == ["pot"]
    palettes = addon.steps.extract_palette(project_scene).wait()
    assert [(palette.name, palette.colors.shape) for palette in palettes] == [("lid", (3, 3)), ("pot", (3, 3))]
    assert project_scene.karf.objects.keys() == ["lid", "pot"]
    assert [swatch.locked for swatch in project_scene.karf.objects["pot"].swatches] == [True, False, False]
    np.testing.assert_array_equal(levels(addon, project_scene), BASE)
    assert (addon.images.pixels(project_scene.karf.result)[..., 3] == 1).all()


# a color of the pot's swatch, which has a weight of 1/4 in every pixel, and the change of the picture;
# in a color brighter than white, only the picture is clipped
CHANGES = [((0.0, 0.6, 0.1), (-0.2, 0.1, 0.0)), ((1.6, 0.2, 0.1), (0.2, 0.0, 0.0))]


@pytest.mark.parametrize(("color", "change"), CHANGES)
def test_swatch_change_is_added_by_weight_to_every_pixel(bpy, addon, learned, color, change):
    addon.steps.set_swatch(learned, "pot", 1, color)
    np.testing.assert_allclose(learned.karf.objects["pot"].swatches[1].color, color, atol=1e-6)
    assert_shows(addon, learned, change)
    bpy.ops.karf.reset_swatch(object_name="pot", index=1)
    np.testing.assert_array_equal(levels(addon, learned), BASE)


def test_black_is_fixed_and_paper_compositing_shows_palettes_only(addon, learned):
    learned.karf.objects["pot"].swatches[0].color = (1, 1, 1)
    np.testing.assert_array_equal(levels(addon, learned), BASE)
    learned.karf.compositing = "paper"
    # both objects are equally probable, so the first (lid) wins everywhere, with weights 1/4, 2/4, 1/4
    expected = 0.5 * np.array([0.2, 0.4, 0.6]) + 0.25
    assert np.abs(levels(addon, learned) / 255 - expected).max() <= 0.51 / 255


def test_driven_swatch_recolors_with_its_driver(bpy, addon, learned):
    empty = bpy.data.objects.new("slider", None)
    learned.collection.objects.link(empty)
    curve = learned.driver_add('karf.objects["pot"].swatches[1].color', 0)
    curve.driver.type = "SUM"
    target = curve.driver.variables.new().targets[0]
    target.id, target.data_path = empty, "location.x"
    for red in (0.0, 0.4):
        empty.location.x = red
        bpy.context.view_layer.update()
        assert_shows(addon, learned, ((red - RED[0]) / 4, 0, 0))


def test_showing_a_view_needs_the_engine_only_once(addon, learned, monkeypatch):
    addon.steps.show_view(learned, "photo_1").wait()
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere")
    addon.steps.show_view(learned, "photo_0").wait()
    addon.steps.show_view(learned, "photo_1").wait()
    with pytest.raises(addon.engine_api.MissingDependency):
        addon.steps.show_view(learned, "photo_2").wait()


def test_view_without_current_planes_shows_its_photo_or_black(addon, learned):
    project = addon.folders.project_of(learned)
    addon.steps.prepare_views(learned, "photo_1").wait()
    assert addon.disk.is_current(project, "photo_1") and addon.disk.is_prepared(learned)
    project.finish("recoloring", "anew")
    assert not addon.disk.is_current(project, "photo_1")
    for name in ("photo_1", "photo_2"):
        learned.karf.active_view = name
        photo = addon.images.read_picture(addon.captures.view_of(learned, name).image)
        np.testing.assert_array_equal(levels(addon, learned), np.rint(photo * 255))
    addon.captures.view_of(learned, "photo_0").image.unlink()
    learned.karf.active_view = "photo_0"
    assert not levels(addon, learned).any()


def test_views_of_other_sizes_reuse_the_same_image(addon, learned):
    image = learned.karf.result
    learned.karf.active_view = "photo_2"
    learned.karf.active_view = "photo_0"
    np.testing.assert_array_equal(levels(addon, learned), BASE)
    full = addon.engine_api.read_planes(addon.disk.planes_file(learned))
    weights, probabilities = full.palette_weights[..., :8, :], full.probabilities[..., :8, :]
    write_current_planes(addon, learned, type(full)(full.objects, weights, probabilities, full.base[:8]))
    addon.steps.show_view(learned).wait()
    assert learned.karf.result == image and tuple(image.size) == (24, 8)
    np.testing.assert_array_equal(levels(addon, learned), BASE[:8])


@pytest.mark.parametrize("mode", ["delta", "paper"])
def test_planes_of_a_larger_palette_are_rejected(addon, learned, mode):
    planes = addon.engine_api.read_planes(addon.disk.planes_file(learned))
    larger = np.concatenate([planes.palette_weights, planes.palette_weights[:, :1]], axis=1)
    write_current_planes(addon, learned, type(planes)(planes.objects, larger, planes.probabilities, planes.base))
    learned.karf.compositing = mode
    with pytest.raises(addon.engine_api.DataError, match="other palettes"):
        addon.displayed.of(learned).edited()


def test_each_scene_has_its_own_picture_and_cache(bpy, addon, learned, monkeypatch):
    addon.steps.prepare_views(learned, "photo_1").wait()
    second = learned.copy()
    second.karf.result = None
    second.karf.active_view = "photo_1"
    addon.displayed.of(second).recolor()
    with monkeypatch.context() as patch:
        patch.setattr(addon.displayed, "read_planes", lambda file: pytest.fail(f"{file} is read again"))
        for scene, other in ((learned, second), (second, learned)):
            before = levels(addon, other)
            scene.karf.objects["pot"].swatches[1].color = (0.0, 0.6, 0.1)
            assert_shows(addon, scene, (-0.2, 0.1, 0.0))
            np.testing.assert_array_equal(levels(addon, other), before)
    kept, uid = addon.displayed.of(second).view, second.session_uid
    addon.displayed.forget(learned)
    assert addon.displayed.of(learned).view is None and addon.displayed.of(second).view is kept
    bpy.data.scenes.remove(second)
    learned.frame_set(learned.frame_current)
    known = addon.session.get(addon.displayed._State).scenes
    assert uid not in known and learned.session_uid in known
