"""Swatches to pixels: exact values, undo, keyframes, save and load."""

import numpy as np
import pytest

from ..prepared import write_current_planes


def test_the_whole_way_from_capture_to_swatches(bpy, addon, capture_folder, tmp_path):
    addon.steps.import_capture(bpy.context.scene, capture_folder, tmp_path / "project")
    assert addon.steps.learn_scene(bpy.context.scene, "demo", ["geometry.max_rays=64"]).wait()["psnr"] == 30
    addon.images.write_png(tmp_path / "given" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    assert addon.steps.segment(bpy.context.scene, tmp_path / "given").wait()["objects"] == ["pot"]
    palettes = addon.steps.extract_palette(bpy.context.scene).wait()
    assert [(palette.name, palette.colors.shape) for palette in palettes] == [("lid", (3, 3)), ("pot", (3, 3))]
    assert tuple(bpy.context.scene.karf.result.size) == (24, 16)


def base(height=16, width=24):
    """The fake engine's photo, 8 bit."""
    return (np.arange(height * width * 3) % 256).reshape(height, width, 3)


def shown(addon, scene):
    """The result image, 8 bit."""
    return np.rint(addon.images.pixels(scene.karf.result)[..., :3] * 255).astype(int)


def test_palettes_arrive_as_swatches_with_a_frozen_black(addon, learned):
    assert [item.name for item in learned.karf.objects] == ["lid", "pot"]
    pot = learned.karf.objects["pot"]
    assert [swatch.locked for swatch in pot.swatches] == [True, False, False]
    np.testing.assert_allclose(pot.swatches[1].color[:], (0.8, 0.2, 0.1), atol=1e-7)


def test_an_unchanged_palette_shows_the_photo_byte_for_byte(addon, learned):
    np.testing.assert_array_equal(shown(addon, learned), base())
    assert (addon.images.pixels(learned.karf.result)[..., 3] == 1).all()


def test_a_swatch_edit_adds_its_share_of_the_change_to_every_pixel(addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, (0.0, 0.6, 0.1))
    # the swatch has a quarter of every pixel: -0.8 / 4 red, +0.4 / 4 green
    expected = np.clip(base() / 255 + [-0.2, 0.1, 0.0], 0, 1) * 255
    assert np.abs(shown(addon, learned) - expected).max() <= 0.5 + 1e-3


def test_resetting_a_swatch_gives_the_photo_back(bpy, addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, "#00ff00")
    assert not np.array_equal(shown(addon, learned), base())
    bpy.ops.karf.reset_swatch(object_name="pot", index=1)
    np.testing.assert_array_equal(shown(addon, learned), base())


def test_paper_compositing_replaces_pixels_by_the_palette(addon, learned):
    learned.karf.compositing = "paper"
    # both objects are equally probable, the background impossible: the first (lid) wins everywhere with shares 1 2 1 / 4
    expected = 0.5 * np.array([0.2, 0.4, 0.6]) + 0.25
    assert np.abs(shown(addon, learned) / 255 - expected).max() <= 0.51 / 255


def test_undo_and_redo_bring_the_picture_along(bpy, addon, learned):
    bpy.ops.ed.undo_push(message="before")
    addon.steps.set_swatch(bpy.context.scene, "pot", 1, "#00ff00")
    changed = shown(addon, learned)
    bpy.ops.ed.undo_push(message="swatch")
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(shown(addon, bpy.context.scene), base())
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(shown(addon, bpy.context.scene), changed)


def test_a_keyframed_swatch_recolors_on_every_frame(addon, learned):
    swatch = learned.karf.objects["pot"].swatches[1]
    swatch.keyframe_insert("color", frame=1)
    swatch.color = (0.0, 0.2, 0.1)
    swatch.keyframe_insert("color", frame=11)
    learned.frame_set(1)
    np.testing.assert_array_equal(shown(addon, learned), base())
    learned.frame_set(6)  # half way, by the symmetry of the ease: red 0.4, a change of -0.4 / 4
    expected = np.clip(base() / 255 + [-0.1, 0, 0], 0, 1) * 255
    assert np.abs(shown(addon, learned) - expected).max() <= 0.5 + 1e-2


def test_the_file_keeps_swatches_view_and_picture(bpy, addon, learned, tmp_path):
    addon.steps.show_view(learned, "photo_2").wait()
    addon.steps.set_swatch(learned, "lid", 2, (0.25, 0.5, 0.75))
    expected = shown(addon, learned)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    scene = bpy.context.scene
    assert tuple(scene.karf.objects["lid"].swatches[2].color) == (0.25, 0.5, 0.75)
    assert scene.karf.active_view == "photo_2"
    np.testing.assert_array_equal(shown(addon, scene), expected)
    addon.steps.set_swatch(scene, "lid", 2, (1, 1, 1))
    np.testing.assert_array_equal(shown(addon, scene), base())


def test_the_picture_survives_without_its_project(bpy, addon, learned, tmp_path):
    addon.steps.set_swatch(learned, "pot", 1, "#0000ff")
    expected = shown(addon, learned)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    addon.disk.planes_file(learned).unlink()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    np.testing.assert_array_equal(shown(addon, bpy.context.scene), expected)


def test_an_edit_file_gives_the_same_swatches_back(bpy, addon, learned, tmp_path):
    addon.steps.set_swatch(learned, "pot", 2, (0.1, 0.2, 0.3))
    bpy.ops.karf.save_edit(filepath=str(tmp_path / "edit.json"))
    edited = shown(addon, learned)
    bpy.ops.karf.reset_swatch(object_name="pot")
    bpy.ops.karf.load_edit(filepath=str(tmp_path / "edit.json"))
    np.testing.assert_array_equal(shown(addon, learned), edited)
    np.testing.assert_allclose(learned.karf.objects["pot"].swatches[2].color[:], (0.1, 0.2, 0.3), atol=1e-7)


@pytest.mark.parametrize("suffix", [".gpl", ".ase"])
def test_palettes_of_other_programs_are_saved_and_loaded_as_edits(bpy, addon, learned, tmp_path, suffix):
    path, color = tmp_path / f"blue{suffix}", np.array((51, 102, 255), np.float32) / 255
    addon.steps.set_swatch(learned, "pot", 2, color)
    addon.steps.save_edit(learned, path)
    addon.edits.reset(learned, "pot")
    learned.karf.compositing = "paper"
    assert bpy.ops.karf.load_edit(filepath=str(path)) == {"FINISHED"}
    np.testing.assert_allclose(learned.karf.objects["pot"].swatches[2].color, color, atol=1e-6)
    assert learned.karf.compositing == "paper"


def test_becomes_moves_the_source_to_the_target_and_leaves_locked_swatches(bpy, addon, learned):
    item = learned.karf.objects["pot"]
    item.source, item.target = (0.8, 0.2, 0.1), (0.1, 0.3, 0.8)
    item.swatches[2].locked = True
    kept = item.swatches[2].color[:]
    assert bpy.ops.karf.becomes(object_name="pot") == {"FINISHED"}
    # the histogram's first color is the swatch itself, with weight 1; the solver's ridge keeps it a little short
    np.testing.assert_allclose(item.swatches[1].color[:], (0.1, 0.3, 0.8), atol=0.01)
    assert item.swatches[2].color[:] == kept
    item.rule = "fewest"
    bpy.ops.karf.becomes(object_name="pot")
    np.testing.assert_allclose(item.swatches[1].color[:], (0.1, 0.3, 0.8), atol=1e-3)


def test_a_swatch_brighter_than_white_keeps_its_value_and_clips_only_the_picture(bpy, addon, learned, tmp_path):
    addon.steps.set_swatch(learned, "pot", 1, (1.6, 0.2, 0.1))
    assert learned.karf.objects["pot"].swatches[1].color[0] == pytest.approx(1.6)
    # a quarter of +0.8 red
    expected = np.clip(base() / 255 + [0.2, 0.0, 0.0], 0, 1) * 255
    assert np.abs(shown(addon, learned) - expected).max() <= 0.5 + 1e-3
    bpy.ops.karf.save_edit(filepath=str(tmp_path / "edit.json"))
    bpy.ops.karf.reset_swatch(object_name="pot")
    bpy.ops.karf.load_edit(filepath=str(tmp_path / "edit.json"))
    assert learned.karf.objects["pot"].swatches[1].color[0] == pytest.approx(1.6)


def test_black_cannot_be_edited(addon, learned):
    learned.karf.objects["pot"].swatches[0].color = (1, 1, 1)
    np.testing.assert_array_equal(shown(addon, learned), base())
    with pytest.raises(addon.engine_api.BadRequest, match="no swatch 0"):
        addon.steps.set_swatch(learned, "pot", 0, "#ffffff")


def test_an_unknown_object_or_view_is_refused_with_what_there_is(addon, learned):
    with pytest.raises(addon.engine_api.BadRequest, match="lid, pot"):
        addon.steps.set_swatch(learned, "kettle", 1, "#ffffff")
    with pytest.raises(addon.engine_api.BadRequest, match="photo_9"):
        addon.steps.show_view(learned, "photo_9").wait()


def test_a_shown_view_needs_the_engine_only_once(addon, learned, monkeypatch):
    addon.steps.show_view(learned, "photo_1").wait()
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere")
    addon.steps.show_view(learned, "photo_0").wait()
    addon.steps.show_view(learned, "photo_1").wait()
    with pytest.raises(addon.engine_api.MissingDependency):
        addon.steps.show_view(learned, "photo_2").wait()


def test_learning_anew_makes_prepared_views_stale(addon, learned):
    project = addon.folders.project_of(learned)
    assert addon.disk.is_current(project, "photo_0")
    addon.steps.prepare_views(learned, "photo_1").wait()
    project.finish("recoloring", "anew")
    assert not addon.disk.is_current(project, "photo_1")


def test_pictures_of_views_of_different_sizes_share_one_image(addon, learned):
    image = learned.karf.result
    small = addon.engine_api.read_planes(addon.disk.planes_file(learned))
    half = type(small)(
        small.objects, small.palette_weights[..., :8, :], small.probabilities[..., :8, :], small.base[:8]
    )
    write_current_planes(addon, learned, half)
    addon.steps.show_view(learned).wait()
    assert learned.karf.result == image and tuple(image.size) == (24, 8)
    np.testing.assert_array_equal(shown(addon, learned), base()[:8])


def test_a_driven_swatch_recolors_when_its_driver_changes(bpy, addon, learned):
    empty = bpy.data.objects.new("slider", None)
    learned.collection.objects.link(empty)
    curve = learned.driver_add('karf.objects["pot"].swatches[1].color', 0)
    curve.driver.type = "SUM"
    target = curve.driver.variables.new().targets[0]
    target.id, target.data_path = empty, "location.x"
    for red in (0.0, 0.4):
        empty.location.x = red
        bpy.context.view_layer.update()
        expected = np.clip(base() / 255 + [(red - 0.8) / 4, 0, 0], 0, 1) * 255
        assert np.abs(shown(addon, learned) - expected).max() <= 0.5 + 1e-2


def photo(addon, scene, name):
    """A view's photo as read, 8 bit."""
    return np.rint(addon.images.read_picture(addon.captures.view_of(scene, name).image) * 255).astype(int)


def test_a_view_that_is_not_prepared_shows_its_own_photo(addon, learned):
    learned.karf.active_view = "photo_2"
    assert not addon.disk.is_prepared(learned)
    np.testing.assert_array_equal(shown(addon, learned), photo(addon, learned, "photo_2"))
    learned.karf.active_view = "photo_0"
    np.testing.assert_array_equal(shown(addon, learned), base())


def test_a_view_prepared_for_older_palettes_shows_its_own_photo(addon, learned):
    addon.steps.prepare_views(learned, "photo_1").wait()
    addon.folders.project_of(learned).finish("recoloring", "anew")
    learned.karf.active_view = "photo_1"
    np.testing.assert_array_equal(shown(addon, learned), photo(addon, learned, "photo_1"))


def test_a_photo_that_is_gone_leaves_no_other_views_picture(addon, learned):
    addon.captures.view_of(learned, "photo_2").image.unlink()
    learned.karf.active_view = "photo_2"
    assert not shown(addon, learned).any()


@pytest.mark.parametrize("mode", ["delta", "paper"])
def test_planes_of_a_larger_palette_are_refused_in_a_sentence(addon, learned, mode):
    planes = addon.engine_api.read_planes(addon.disk.planes_file(learned))
    larger = np.concatenate([planes.palette_weights, planes.palette_weights[:, :1]], axis=1)
    larger = type(planes)(planes.objects, larger, planes.probabilities, planes.base)
    write_current_planes(addon, learned, larger)
    learned.karf.compositing = mode
    with pytest.raises(addon.engine_api.DataError, match="other palettes"):
        addon.displayed.of(learned).edited()


@pytest.fixture
def two_scenes(addon, learned):
    """The scene, and a copy of it with a result image of its own that shows another view."""
    addon.steps.prepare_views(learned, "photo_1").wait()
    other = learned.copy()
    other.karf.result = None
    other.karf.active_view = "photo_1"
    addon.displayed.of(other).recolor()
    return learned, other


def test_each_scene_has_its_own_picture_and_reads_its_planes_once(addon, two_scenes, monkeypatch):
    def read_planes(file):
        raise AssertionError(f"{file} is read again")

    monkeypatch.setattr(addon.displayed, "read_planes", read_planes)
    first, second = two_scenes
    for scene, other in (two_scenes, two_scenes[::-1]):
        before = shown(addon, other)
        scene.karf.objects["pot"].swatches[1].color = (0.0, 0.6, 0.1)
        assert (shown(addon, scene) != base()).any()
        np.testing.assert_array_equal(shown(addon, other), before)
    np.testing.assert_array_equal(shown(addon, first), shown(addon, second))


def test_a_scene_read_anew_leaves_what_others_have_in_memory(addon, two_scenes):
    first, second = two_scenes
    kept = addon.displayed.of(second).view
    addon.displayed.forget(first)
    assert addon.displayed.of(first).view is None and addon.displayed.of(second).view is kept


def test_what_a_removed_scene_has_shown_leaves_memory(bpy, addon, two_scenes):
    first, second = two_scenes
    uid = second.session_uid
    assert uid in addon.session.get(addon.displayed._State).scenes
    bpy.data.scenes.remove(second)
    first.frame_set(first.frame_current)
    assert (
        uid not in addon.session.get(addon.displayed._State).scenes
        and first.session_uid in addon.session.get(addon.displayed._State).scenes
    )
