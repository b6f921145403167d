"""Pictures on disk: the shown view, captured views, and a Blender camera's frames with keyframed swatches."""

import json
from pathlib import Path

import numpy as np
import pytest


def test_the_shown_view_is_written_as_shown_whatever_the_view_transform(bpy, addon, learned, tmp_path):
    learned.karf.out = str(tmp_path / "out")
    addon.steps.set_swatch(learned, "pot", 1, (0.4, 0.2, 0.5))
    written = addon.images.read_picture(addon.steps.save_shown(learned))
    assert (tmp_path / "out" / "recolor" / "photo_0.png").is_file()
    np.testing.assert_array_equal(written, addon.images.pixels(learned.karf.result)[..., :3])
    base = (np.arange(16 * 24 * 3) % 256).reshape(16, 24, 3) / 255
    expected = np.clip(base + np.array((-0.1, 0, 0.1)), 0, 1)
    assert np.abs(written - expected).max() <= 0.51 / 255


def test_a_script_makes_an_edit_of_its_own_and_applies_it(bpy, addon, learned):
    palettes = {palette.name: palette.colors.copy() for palette in addon.colors.palettes(bpy.context.scene)}
    palettes["pot"][1] = (0.1, 0.2, 0.3)
    addon.steps.apply_edit(learned, addon.steps.Edit(palettes))
    edited = addon.edits.current_edit(bpy.context.scene).colors["pot"]
    np.testing.assert_allclose(edited, palettes["pot"], atol=1e-6)


def test_this_view_is_written_by_the_engine_at_the_size_of_its_photo(bpy, addon, learned, tmp_path):
    learned.karf.out = str(tmp_path / "out")
    addon.steps.set_swatch(learned, "pot", 1, "#204060")
    assert bpy.ops.karf.render_view() == {"FINISHED"}
    written = addon.images.read_picture(tmp_path / "out" / "recolor" / "photo_0.png")
    np.testing.assert_allclose(written[0, 0] * 255, (32, 64, 96), atol=1e-4)
    assert addon.steps.render_view(learned).wait() == tmp_path / "out" / "recolor" / "photo_0.png"
    assert addon.steps.render_view(learned).requests[0].options["size"] == "photo"
    assert addon.steps.render_view(learned, 300).requests[0].options["size"] == 300


def test_without_the_engine_this_view_is_the_preview_and_says_so(bpy, addon, learned, tmp_path, monkeypatch):
    learned.karf.out = str(tmp_path / "out")
    monkeypatch.setenv("KARF_ENGINE_PYTHON", str(tmp_path / "no python"))
    addon.preferences.current().engine_python = ""
    assert bpy.ops.karf.render_view() == {"FINISHED"}
    written = addon.images.read_picture(tmp_path / "out" / "recolor" / "photo_0.png")
    np.testing.assert_array_equal(written, addon.images.pixels(learned.karf.result)[..., :3])


def test_views_of_the_same_photo_name_are_written_to_files_of_their_own(bpy, addon, two_splits, tmp_path):
    """The engine writes each to the same file as Blender, rendered alone or not."""
    addon.steps.import_capture(bpy.context.scene, two_splits, tmp_path / "project")
    addon.steps.learn_scene(bpy.context.scene).wait()
    addon.steps.extract_palette(bpy.context.scene).wait()
    written = []
    for view in ("train_r_000", "test_r_000"):
        addon.steps.show_view(bpy.context.scene, view).wait()
        written.append(addon.steps.save_shown(bpy.context.scene))
    addon.steps.render_captured(bpy.context.scene, "test_r_000").wait()
    assert len(set(written)) == 2
    assert sorted(written[0].parent.iterdir()) == sorted(written)


def test_captured_views_are_rendered_with_the_edit(addon, learned, tmp_path):
    addon.steps.set_swatch(learned, "pot", 1, "#204060")
    folder = addon.steps.render_captured(learned, "all", tmp_path / "out").wait()
    assert sorted(path.name for path in folder.iterdir()) == ["photo_0.png", "photo_1.png", "photo_2.png"]
    np.testing.assert_allclose(addon.images.read_picture(folder / "photo_1.png")[0, 0] * 255, (32, 64, 96), atol=1e-4)


def test_photos_have_the_size_that_the_panel_says_unless_a_call_says_another(addon, learned):
    def asked(size=None):
        return addon.steps.render_captured(learned, "all", size=size).requests[0].options["size"]

    assert asked() == "photo"
    learned.karf.captured_size = "LEARNED"
    assert asked() == "learned" and asked("photo") == "photo"
    learned.karf.captured_size, learned.karf.captured_pixels = "PIXELS", 900
    assert asked() == 900 and asked(64) == 64


def test_a_cameras_frames_are_rendered_with_keyframed_swatches(bpy, addon, learned, tmp_path):
    swatch = learned.karf.objects["pot"].swatches[1]
    for frame, color in ((1, (0.0, 0.2, 0.2)), (3, (0.4, 0.2, 0.2))):
        swatch.color = color
        swatch.keyframe_insert("color", frame=frame)
    learned.frame_start, learned.frame_end = 1, 5
    learned.frame_set(2)
    folder = addon.steps.render_sequence(learned, out=tmp_path / "out").wait()
    pictures = [addon.images.read_picture(folder / f"frame_{frame:04d}.png") for frame in range(1, 6)]
    reds = [picture[0, 0, 0] for picture in pictures]
    # eased keys are symmetric: half way at frame 2, still after frame 3
    np.testing.assert_allclose(reds, [0, 0.2, 0.4, 0.4, 0.4], atol=0.5 / 255 + 1e-3)
    assert learned.frame_current == 2
    assert pictures[0].shape == (16, 24, 3)


def test_a_sequence_is_one_job_with_an_edit_for_each_of_its_swatches(bpy, addon, learned):
    swatch = learned.karf.objects["pot"].swatches[1]
    for frame, red in ((1, 0.0), (3, 0.4)):
        swatch.color = (red, 0.2, 0.2)
        swatch.keyframe_insert("color", frame=frame)
    task = addon.steps.render_sequence(learned, learned.camera, range(1, 31))
    assert len(task.requests) == 1
    options = task.requests[0].options
    assert len(json.loads(Path(options["views"]).read_text())["frames"]) == len(options["edit"]) == 30
    assert len(set(options["edit"])) == 3 and set(options["edit"][2:]) == {options["edit"][2]}
    assert options["base"] == "render"


@pytest.mark.parametrize("names", [("Left", "Right"), ("a/b", "a_b"), ("Cam", "cam"), ("..", "__"), ("aux", "aux.001")])
def test_two_cameras_never_share_a_picture(bpy, addon, learned, tmp_path, names):
    folders = []
    for name in names:
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        learned.collection.objects.link(camera)
        folders.append((camera, addon.steps.camera_folder(learned, camera)))
    folders = [addon.steps.render_sequence(learned, camera, [1], tmp_path / "out").wait() for camera, _ in folders]
    assert len({str(folder).casefold() for folder in folders}) == 2
    assert all(addon.engine_api.is_file_name(part) for folder in folders for part in folder.relative_to(tmp_path).parts)
    assert all(folder.parents[2] == tmp_path / "out" and (folder / "frame_0001.png").exists() for folder in folders)


def test_a_moving_camera_reaches_the_engine_frame_by_frame(bpy, addon, learned, tmp_path):
    camera = learned.camera
    camera.parent = None
    for frame, x in ((1, 0.0), (2, 5.0)):
        camera.location = (x, 0, 2)
        camera.keyframe_insert("location", frame=frame)
    task = addon.steps.render_sequence(learned, camera, [1, 2])
    capture = addon.engine_api.open_capture(task.requests[0].options["views"], photos=False)
    np.testing.assert_allclose([view.camera.position for view in capture.views], [(0, 0, 2), (5, 0, 2)], atol=1e-6)
    assert [view.name for view in capture.views] == ["frame_0001", "frame_0002"]


def test_rendering_without_palettes_or_camera_is_refused(bpy, addon, learned):
    learned.camera = None
    with pytest.raises(addon.engine_api.BadRequest, match="has no camera"):
        addon.steps.render_sequence(learned).wait()
    learned.karf.objects.clear()
    assert not bpy.ops.karf.render_camera.poll() and not bpy.ops.karf.render_view.poll()


def test_the_dialogs_frames_are_rendered_and_the_scene_keeps_its_own(bpy, addon, learned, tmp_path):
    learned.karf.out = str(tmp_path / "out")
    assert bpy.ops.karf.render_camera(frame_start=4, frame_end=8, frame_step=2) == {"FINISHED"}
    written = sorted(path.stem for path in (addon.steps.camera_folder(learned) / "recolor").iterdir())
    assert written == ["frame_0004", "frame_0006", "frame_0008"]
    assert (learned.frame_start, learned.frame_end) == (1, 250)
