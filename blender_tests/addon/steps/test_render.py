"""Pictures on disk: the displayed view, captured views, a Blender camera's frames, also by a farm, and back in Blender."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from karf_engine.commands.options import options_of_job


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


@pytest.mark.skipif(sys.platform != "linux", reason="other systems open folders otherwise")
def test_the_folders_in_which_files_appear_are_opened(bpy, addon, learned, tmp_path, monkeypatch):
    opened = []
    # what Blender's own operator calls
    monkeypatch.setattr(subprocess, "check_call", lambda command: opened.append(command[-1]))
    with pytest.raises(RuntimeError, match="does not exist yet"):
        bpy.ops.karf.open_folder(folder="out")
    bpy.ops.karf.open_folder(folder="project")
    frames = addon.steps.render_captured(learned, "all", tmp_path / "elsewhere").wait()
    bpy.ops.karf.open_folder(folder="frames")
    bpy.ops.karf.open_folder(folder="written")
    assert opened == [str(addon.folders.project_of(learned).folder), str(frames), str(frames)]
    bpy.ops.karf.export_cameras(filepath=str(tmp_path / "film" / "cameras.json"))
    bpy.ops.karf.open_folder(folder="written")
    assert opened[-1] == str(tmp_path / "film")


# --- frames back in Blender ------------------------------------------------------------------------------------------
@pytest.fixture
def film(addon, learned, tmp_path):
    """The scene with five frames of its camera rendered."""
    learned.frame_start, learned.frame_end = 3, 7
    addon.steps.render_sequence(learned, out=tmp_path / "out").wait()
    return learned


def test_a_cameras_frames_are_loaded_as_a_sequence(bpy, addon, film):
    image = bpy.data.images[addon.sequences.NAME]
    assert image.source == "SEQUENCE" and image.filepath.endswith("frame_0003.png")


def test_an_editor_shows_the_frame_of_the_scene(bpy, addon, film):
    (area,) = [area for area in bpy.context.screen.areas if area.type == "IMAGE_EDITOR"] or [
        bpy.context.screen.areas[0]
    ]
    kind, area.type = area.type, "IMAGE_EDITOR"
    bpy.context.screen.use_play_image_editors = False
    try:
        image, user = addon.steps.show_frames(film), area.spaces.active.image_user
        assert area.spaces.active.image == image
        assert (user.frame_start, user.frame_offset, user.frame_duration, user.use_auto_refresh) == (3, 2, 5, True)
        assert bpy.context.screen.use_play_image_editors  # Space over the 3D View plays it too
    finally:
        area.type = kind


def test_frames_loaded_again_are_the_same_image(bpy, addon, film):
    first = bpy.data.images[addon.sequences.NAME]
    assert first.name == addon.steps.show_frames(film).name
    assert len([image for image in bpy.data.images if image.name.startswith(addon.sequences.NAME)]) == 1


def test_one_click_makes_a_strip(bpy, addon, film):
    assert bpy.ops.karf.add_strip() == {"FINISHED"}
    (strip,) = addon.compat.strips_of(film)
    assert (addon.compat.strip_range(strip), strip.channel) == ((3, 8), 1)
    assert [element.filename for element in strip.elements] == [f"frame_{number:04d}.png" for number in range(3, 8)]
    assert bpy.path.abspath(strip.directory).rstrip("/").endswith("recolor")
    assert all(getattr(workspace, "sequencer_scene", film) == film for workspace in bpy.data.workspaces)
    bpy.ops.karf.add_strip()  # beside the first
    assert sorted(strip.channel for strip in addon.compat.strips_of(film)) == [1, 2]


def test_frames_of_an_earlier_longer_job_are_left_out(addon, film, tmp_path):
    film.frame_end = 5
    addon.steps.render_sequence(film, out=tmp_path / "out").wait()
    assert addon.compat.strip_range(addon.steps.add_strip(film)) == (3, 6)


def test_captured_views_are_loaded_in_their_order(addon, learned, tmp_path):
    folder = addon.steps.render_captured(learned, "all", tmp_path / "out").wait()
    assert addon.steps.show_frames(learned).source == "SEQUENCE"  # photo_0, photo_1 ..
    strip = addon.steps.add_strip(learned, folder)
    assert [element.filename for element in strip.elements] == ["photo_0.png", "photo_1.png", "photo_2.png"]
    assert addon.compat.strip_range(strip) == (1, 4)


def test_the_engine_is_asked_to_skip_what_is_there(addon, learned, tmp_path):
    folder = addon.steps.render_captured(learned, "all", tmp_path / "out").wait()
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    addon.steps.render_captured(learned, "all").wait()
    assert before == {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    addon.steps.render_captured(learned, "all", skip_existing=False).wait()
    assert before != {path: path.stat().st_mtime_ns for path in folder.iterdir()}


def test_the_buttons_wait_for_frames(bpy, addon, learned):
    assert not bpy.ops.karf.add_strip.poll() and not bpy.ops.karf.show_frames.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="No frames have been rendered"):
        addon.steps.show_frames(learned)


def test_a_folder_without_frames_is_told(addon, learned, tmp_path):
    with pytest.raises(addon.engine_api.BadRequest, match="There are no frames in"):
        addon.steps.add_strip(learned, tmp_path)


@pytest.mark.parametrize(
    ("file_format", "depth", "mode", "expected"),
    [
        ("PNG", "8", "RGB", ("png8", False)),
        ("PNG", "16", "RGBA", ("png16", True)),
        ("OPEN_EXR", "16", "RGBA", ("exr16", True)),
        ("OPEN_EXR", "32", "RGB", ("exr32", False)),
    ],
)
def test_the_engine_is_asked_for_the_chosen_output(addon, learned, tmp_path, file_format, depth, mode, expected):
    learned.karf.file_format, learned.karf.color_depth, learned.karf.color_mode = file_format, depth, mode
    (request,) = addon.steps.render_sequence(learned, None, [1]).requests
    assert (request.options["format"], request.options["alpha"]) == expected
    options_of_job(request.stage, request.project, request.options)


# --- farm ------------------------------------------------------------------------------------------------------------
@pytest.fixture
def filmed(bpy, addon, learned):
    """The learned scene with a camera, four frames and a swatch that changes over them."""
    camera = bpy.data.objects.new("Path", bpy.data.cameras.new("Path"))
    learned.collection.objects.link(camera)
    learned.camera = camera
    learned.frame_start, learned.frame_end = 11, 14
    swatch = learned.karf.objects[0].swatches[1]
    for frame, color in ((11, (0.2, 0.4, 0.6)), (14, (0.8, 0.4, 0.2))):
        swatch.color = color
        swatch.keyframe_insert("color", frame=frame)
    return learned


def parameters(bundle):
    template = json.loads((bundle / "template.json").read_text())
    return {entry["name"]: entry["default"] for entry in template["parameterDefinitions"]}


def test_the_job_has_the_cameras_and_the_swatches_of_each_frame(addon, filmed, tmp_path):
    bundle = addon.steps.farm_bundle(filmed, out=tmp_path / "job", per_task=3)
    names = [f"frame_{number:04d}" for number in range(11, 15)]
    frames = json.loads((bundle / "cameras.json").read_text())["frames"]
    assert [frame["file_path"] for frame in frames] == names
    edits = {path.stem: json.loads(path.read_text())["objects"] for path in (bundle / "edits").iterdir()}
    assert sorted(edits) == names
    assert edits["frame_0011"] != edits["frame_0014"]
    told = parameters(bundle)
    assert (told["FirstFrame"], told["LastFrame"], told["FramesPerTask"]) == (1, 4, 3)


def test_the_job_renders_as_the_panel_says(addon, filmed, tmp_path):
    filmed.karf.file_format, filmed.karf.color_depth, filmed.karf.color_mode = "OPEN_EXR", "16", "RGBA"
    bundle = addon.steps.farm_bundle(filmed, out=tmp_path / "job")
    (step,) = json.loads((bundle / "template.json").read_text())["steps"]
    arguments = " ".join(step["script"]["actions"]["onRun"]["args"])
    assert "--base render --alpha --format exr16" in arguments


def test_the_button_writes_a_new_folder_each_time(bpy, addon, filmed):
    for name in ("Path", "Path_2"):
        assert bpy.ops.karf.farm_bundle(per_task=2) == {"FINISHED"}
        bundle = addon.folders.out_folder(filmed) / "farm" / name
        assert (bundle / "engine" / "karf_engine" / "__main__.py").is_file()
        assert (bundle / "project" / "project.json").is_file()


def test_without_a_camera_the_button_says_so(bpy, addon, filmed):
    filmed.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.karf.farm_bundle()
