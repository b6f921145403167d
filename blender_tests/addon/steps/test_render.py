"""Rendering to disk: captured views and camera frames, farm bundles, and frames shown in Blender."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from karf_engine.commands.options import options_of_job

DARK = "#204060"
DARK_BYTES = (32, 64, 96)


@pytest.fixture
def dark(addon, learned, tmp_path):
    """The scene with a dark pot and an output folder."""
    addon.steps.set_swatch(learned, "pot", 1, DARK)
    learned.karf.out = str(tmp_path / "out")
    return learned


@pytest.fixture
def keyed(learned):
    """The scene whose pot goes from no red in frame 1 to 0.4 in frame 3."""
    swatch = learned.karf.objects["pot"].swatches[1]
    for frame, red in ((1, 0.0), (3, 0.4)):
        swatch.color = (red, 0.2, 0.2)
        swatch.keyframe_insert("color", frame=frame)
    return learned


def options_of(task):
    (request,) = task.requests
    return request.options


def new_camera(bpy, scene, name):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    scene.collection.objects.link(camera)
    return camera


@pytest.mark.parametrize("has_engine", [False, True])
def test_active_view_is_written_with_and_without_an_engine(bpy, addon, dark, tmp_path, monkeypatch, has_engine):
    if not has_engine:
        monkeypatch.setenv("KARF_ENGINE_PYTHON", str(tmp_path / "no python"))
        addon.preferences.current().engine_python = ""
    assert bpy.ops.karf.render_view() == {"FINISHED"}
    written = addon.images.read_picture(tmp_path / "out" / "Recolored" / "photo_0.png")
    displayed = addon.images.pixels(dark.karf.result)[..., :3]  # whatever the view transform
    if has_engine:
        np.testing.assert_allclose(written[0, 0] * 255, DARK_BYTES, atol=1e-4)
        assert options_of(addon.steps.render_view(dark))["size"] == "photo"
        assert options_of(addon.steps.render_view(dark, 300))["size"] == 300
    else:
        np.testing.assert_array_equal(written, displayed)
        base = (np.arange(16 * 24 * 3) % 256).reshape(16, 24, 3) / 255
        change = (np.array(DARK_BYTES) / 255 - (0.8, 0.2, 0.1)) / 4
        assert np.abs(written - np.clip(base + change, 0, 1)).max() <= 0.51 / 255


def test_views_with_equal_photo_names_get_separate_files(addon, scene, two_splits, tmp_path):
    """The engine and Blender write the same files."""
    addon.steps.import_capture(scene, two_splits, tmp_path / "project")
    addon.steps.learn_scene(scene).wait()
    addon.steps.extract_palette(scene).wait()
    written = []
    for view in ("train_r_000", "test_r_000"):
        addon.steps.show_view(scene, view).wait()
        written.append(addon.steps.save_shown(scene))
    addon.steps.render_captured(scene, "test_r_000").wait()
    assert len(set(written)) == 2 and sorted(written[0].parent.iterdir()) == sorted(written)


def test_captured_views_render_the_edit_and_skip_existing_files(addon, dark):
    def times():
        return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}

    folder = addon.steps.render_captured(dark, "all").wait()
    before = times()
    assert sorted(before) == ["photo_0.png", "photo_1.png", "photo_2.png"]
    np.testing.assert_allclose(addon.images.read_picture(folder / "photo_1.png")[0, 0] * 255, DARK_BYTES, atol=1e-4)
    addon.steps.render_captured(dark, "all").wait()
    assert before == times()
    addon.steps.render_captured(dark, "all", skip_existing=False).wait()
    assert before != times()
    assert addon.steps.show_frames(dark).source == "SEQUENCE"
    strip = addon.steps.add_strip(dark, folder)
    assert [element.filename for element in strip.elements] == sorted(before)
    assert addon.compat.strip_range(strip) == (1, 4)


def test_photo_size_follows_the_panel_unless_given(addon, learned):
    def requested(size=None):
        return options_of(addon.steps.render_captured(learned, "all", size=size))["size"]

    assert requested() == "photo"
    learned.karf.captured_size = "LEARNED"
    assert requested() == "learned" and requested("photo") == "photo"
    learned.karf.captured_size, learned.karf.captured_pixels = "PIXELS", 900
    assert requested() == 900 and requested(64) == 64


def test_camera_frames_render_as_one_job_with_keyframed_swatches(addon, keyed, tmp_path):
    keyed.frame_start, keyed.frame_end = 1, 5
    keyed.frame_set(2)
    folder = addon.steps.render_sequence(keyed, out=tmp_path / "out").wait()
    pictures = [addon.images.read_picture(folder / f"frame_{frame:04d}.png") for frame in range(1, 6)]
    # eased keys are symmetric: half way at frame 2, still after frame 3
    np.testing.assert_allclose([each[0, 0, 0] for each in pictures], [0, 0.2, 0.4, 0.4, 0.4], atol=0.5 / 255 + 1e-3)
    assert keyed.frame_current == 2 and pictures[0].shape == (16, 24, 3)
    options = options_of(addon.steps.render_sequence(keyed, keyed.camera, range(1, 31)))
    assert len(json.loads(Path(options["views"]).read_text())["frames"]) == len(options["edit"]) == 30
    assert len(set(options["edit"])) == 3 and set(options["edit"][2:]) == {options["edit"][2]}
    assert options["base"] == "render"


@pytest.mark.parametrize("names", [("Left", "Right"), ("a/b", "a_b"), ("Cam", "cam"), ("..", "__"), ("aux", "aux.001")])
def test_two_cameras_never_share_a_folder(bpy, addon, learned, tmp_path, names):
    learned.karf.out = str(tmp_path / "out")
    folders = [addon.steps.camera_folder(learned, new_camera(bpy, learned, name)) for name in names]
    assert len({str(folder).casefold() for folder in folders}) == 2
    assert all(addon.engine_api.is_file_name(part) for folder in folders for part in folder.relative_to(tmp_path).parts)
    assert all(folder.parents[1] == tmp_path / "out" for folder in folders)


def test_moving_camera_is_sent_frame_by_frame(addon, learned):
    camera = learned.camera
    camera.parent = None
    for frame, x in ((1, 0.0), (2, 5.0)):
        camera.location = (x, 0, 2)
        camera.keyframe_insert("location", frame=frame)
    options = options_of(addon.steps.render_sequence(learned, camera, [1, 2]))
    views = addon.engine_api.open_capture(options["views"], photos=False).views
    np.testing.assert_allclose([view.camera.position for view in views], [(0, 0, 2), (5, 0, 2)], atol=1e-6)
    assert [view.name for view in views] == ["frame_0001", "frame_0002"]


def test_missing_frames_and_cameras_are_reported(bpy, addon, learned, tmp_path):
    assert not bpy.ops.karf.add_strip.poll() and not bpy.ops.karf.show_frames.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="No frames have been rendered"):
        addon.steps.show_frames(learned)
    with pytest.raises(addon.engine_api.BadRequest, match="There are no frames in"):
        addon.steps.add_strip(learned, tmp_path)
    learned.camera = None
    with pytest.raises(addon.engine_api.BadRequest, match="has no camera"):
        addon.steps.render_sequence(learned).wait()
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.karf.farm_bundle()
    learned.karf.objects.clear()
    assert not bpy.ops.karf.render_camera.poll() and not bpy.ops.karf.render_view.poll()


def test_dialog_frames_are_rendered_without_changing_the_scene(bpy, addon, learned, tmp_path):
    learned.karf.out = str(tmp_path / "out")
    assert bpy.ops.karf.render_camera(frame_start=4, frame_end=8, frame_step=2) == {"FINISHED"}
    written = sorted(path.stem for path in (addon.steps.camera_folder(learned) / "Recolored").iterdir())
    assert written == ["frame_0004", "frame_0006", "frame_0008"]
    assert (learned.frame_start, learned.frame_end) == (1, 250)


OUTPUTS = ("PNG", "8", "RGB"), ("PNG", "16", "RGBA"), ("OPEN_EXR", "16", "RGBA"), ("OPEN_EXR", "32", "RGB")


@pytest.mark.parametrize(("file_format", "depth", "mode"), OUTPUTS)
def test_engine_receives_the_chosen_output_format(addon, learned, file_format, depth, mode):
    learned.karf.file_format, learned.karf.color_depth, learned.karf.color_mode = file_format, depth, mode
    (request,) = addon.steps.render_sequence(learned, None, [1]).requests
    expected = file_format.lower().removeprefix("open_") + depth, mode == "RGBA"
    assert (request.options["format"], request.options["alpha"]) == expected
    options_of_job(request.stage, request.project, request.options)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems open folders otherwise")
def test_output_folders_are_opened(bpy, addon, learned, tmp_path, monkeypatch):
    opened = []  # by Blender's own operator
    monkeypatch.setattr(subprocess, "check_call", lambda command: opened.append(command[-1]))
    with pytest.raises(RuntimeError, match="does not exist yet"):
        bpy.ops.karf.open_folder(folder="out")
    frames = addon.steps.render_captured(learned, "photo_0", tmp_path / "elsewhere").wait()
    for folder in ("project", "frames", "written"):
        bpy.ops.karf.open_folder(folder=folder)
    assert opened == [str(addon.folders.project_of(learned).folder), str(frames), str(frames)]
    bpy.ops.karf.export_cameras(filepath=str(tmp_path / "film" / "cameras.json"))
    bpy.ops.karf.open_folder(folder="written")
    assert opened[-1] == str(tmp_path / "film")


@pytest.fixture
def film(addon, learned, tmp_path):
    """The scene with five frames of its camera rendered."""
    learned.frame_start, learned.frame_end = 3, 7
    addon.steps.render_sequence(learned, out=tmp_path / "out").wait()
    return learned


def test_rendered_frames_form_one_sequence_that_follows_the_scene(bpy, addon, film, image_editor):
    image = bpy.data.images[addon.sequences.NAME]
    assert image.source == "SEQUENCE" and image.filepath.endswith("frame_0003.png")
    bpy.context.screen.use_play_image_editors = False
    image, space = addon.steps.show_frames(film), image_editor.spaces.active
    assert space.image == image
    user = space.image_user
    assert (user.frame_start, user.frame_offset, user.frame_duration, user.use_auto_refresh) == (3, 2, 5, True)
    assert bpy.context.screen.use_play_image_editors  # so Space over the 3D View plays it too
    assert [each.name for each in bpy.data.images if each.name.startswith(addon.sequences.NAME)] == [image.name]


def test_strips_hold_only_the_frames_of_the_last_job(bpy, addon, film, tmp_path):
    assert bpy.ops.karf.add_strip() == {"FINISHED"}
    (strip,) = addon.compat.strips_of(film)
    assert (addon.compat.strip_range(strip), strip.channel) == ((3, 8), 1)
    assert [element.filename for element in strip.elements] == [f"frame_{number:04d}.png" for number in range(3, 8)]
    assert bpy.path.abspath(strip.directory).rstrip("/").endswith("Recolored")
    assert all(getattr(workspace, "sequencer_scene", film) == film for workspace in bpy.data.workspaces)
    bpy.ops.karf.add_strip()  # beside the first
    assert sorted(strip.channel for strip in addon.compat.strips_of(film)) == [1, 2]
    film.frame_end = 5
    addon.steps.render_sequence(film, out=tmp_path / "out").wait()
    assert addon.compat.strip_range(addon.steps.add_strip(film)) == (3, 6)


def test_farm_bundle_has_cameras_and_edits_of_each_frame(bpy, addon, keyed, tmp_path):
    keyed.camera, keyed.frame_start, keyed.frame_end = new_camera(bpy, keyed, "Path"), 1, 4
    keyed.karf.file_format, keyed.karf.color_depth, keyed.karf.color_mode = "OPEN_EXR", "16", "RGBA"
    bundle = addon.steps.farm_bundle(keyed, out=tmp_path / "job", per_task=3)
    names = [f"frame_{number:04d}" for number in range(1, 5)]
    frames = json.loads((bundle / "cameras.json").read_text())["frames"]
    assert [frame["file_path"] for frame in frames] == names
    edits = {path.stem: json.loads(path.read_text())["objects"] for path in (bundle / "edits").iterdir()}
    assert sorted(edits) == names and edits["frame_0001"] != edits["frame_0004"]
    template = json.loads((bundle / "template.json").read_text())
    defaults = {entry["name"]: entry["default"] for entry in template["parameterDefinitions"]}
    assert (defaults["FirstFrame"], defaults["LastFrame"], defaults["FramesPerTask"]) == (1, 4, 3)
    arguments = " ".join(template["steps"][0]["script"]["actions"]["onRun"]["args"])
    assert "--base render --alpha --format exr16" in arguments
    for name in ("Path", "Path_2"):
        assert bpy.ops.karf.farm_bundle(per_task=2) == {"FINISHED"}
        bundle = addon.folders.out_folder(keyed) / "farm" / name
        assert (bundle / "engine" / "karf_engine" / "__main__.py").is_file()
        assert (bundle / "project" / "project.json").is_file()
