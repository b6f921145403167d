"""Rendered frames come back: as an image sequence, and as a strip in the sequencer."""

import pytest

from karf_engine.commands.options import options_of_job


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
