"""Names of recolored pictures: looks and edits never write over each other's files unasked."""

import pytest

RED, DARK, BLUE = "#a02020", "#204060", "#2020a0"


@pytest.fixture
def shot(addon, learned, tmp_path):
    """The scene with a dark pot, no look, and an output folder."""
    addon.steps.set_swatch(learned, "pot", 1, DARK)
    learned.karf.out = str(tmp_path / "out")
    return learned


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def paint(addon, scene, color):
    addon.steps.set_swatch(scene, "pot", 1, color)


def pictures_in(out):
    """Return time and size of each picture by its path without the engine's own folders."""
    found = {path.relative_to(out).as_posix(): path for path in out.rglob("*.png")}
    return {name: path.stat().st_mtime_ns for name, path in found.items() if not name.startswith(("masks/", "render/"))}


def test_two_looks_are_two_folders(bpy, addon, shot, out):
    for name, color in (("Warm", RED), ("Cold", BLUE)):
        paint(addon, shot, color)
        addon.steps.keep_look(shot, name)
        path = out / f"{addon.outputs.shown_path(shot)}.png"
        assert addon.steps.render_view(shot).wait() == path and path.is_file()
    assert sorted(pictures_in(out)) == ["Cold/photo_0.png", "Warm/photo_0.png"]


def test_changed_swatches_get_another_folder_unless_overwrite_is_ticked(addon, shot, out):
    first = addon.steps.render_captured(shot, "photo_0").wait()
    before = pictures_in(out)
    paint(addon, shot, RED)
    assert addon.steps.render_captured(shot, "photo_0").wait() == out / "Recolored_2"
    assert pictures_in(out).items() > before.items()
    paint(addon, shot, DARK)
    assert addon.steps.render_captured(shot, "photo_0,photo_1").wait() == first  # the same swatches
    assert pictures_in(out)["Recolored/photo_0.png"] == before["Recolored/photo_0.png"]
    paint(addon, shot, BLUE)
    shot.karf.overwrite = True
    assert addon.steps.render_captured(shot, "photo_0").wait() == first
    assert pictures_in(out)["Recolored/photo_0.png"] != before["Recolored/photo_0.png"]


def test_a_changed_look_is_not_called_by_its_name(addon, shot):
    addon.steps.keep_look(shot, "Warm")
    assert addon.outputs.shown_path(shot) == "Warm/photo_0"
    paint(addon, shot, RED)
    assert addon.outputs.shown_path(shot) == "Recolored/photo_0"


def test_pictures_of_others_stay(addon, shot, out):
    foreign = out / "Recolored" / "photo_0.tif"
    foreign.parent.mkdir(parents=True)
    foreign.write_bytes(b"of an artist")
    assert addon.steps.render_captured(shot, "photo_0").wait() == out / "Recolored_2"
    assert addon.steps.render_captured(shot, "photo_1").wait() == out / "Recolored"


def test_all_looks_and_single_looks_share_files(addon, shot, out):
    for name, color in (("A", RED), ("B", BLUE)):
        paint(addon, shot, color)
        addon.steps.keep_look(shot, name)
    addon.steps.render_looks(shot, "photo_0").wait()
    assert sorted(pictures_in(out)) == ["A/photo_0.png", "B/photo_0.png"]
    assert addon.steps.render_captured(shot, "photo_0").wait() == out / "B"
    paint(addon, shot, DARK)
    addon.steps.keep_look(shot, "A")  # replaced
    addon.steps.render_looks(shot, "photo_0").wait()
    assert sorted(pictures_in(out)) == ["A/photo_0.png", "A_2/photo_0.png", "B/photo_0.png"]


@pytest.mark.parametrize(
    ("pattern", "path"),
    [
        ("{look}/{view}", "Day_Night/photo_1"),
        ("{view}/{look}", "photo_1/Day_Night"),
        ("{scene}_{look}_{frame}", "Scene_Day_Night_1"),
        ("final/{look}/pot.{view}", "final/Day_Night/pot.photo_1"),
    ],
)
def test_file_names_replace_tokens(addon, shot, out, pattern, path):
    shot.karf.file_names = pattern
    addon.steps.keep_look(shot, "Day/Night")
    addon.steps.render_captured(shot, "photo_1").wait()
    assert list(pictures_in(out)) == [f"{path}.png"]
    assert addon.steps.show_frames(shot).filepath.endswith(f"{path}.png")


@pytest.mark.parametrize("look", ["masks", "Render", "edits"])
def test_looks_keep_out_of_folders_of_other_files(addon, shot, out, look):
    addon.steps.keep_look(shot, look)
    assert addon.steps.render_captured(shot, "photo_0").wait() == out / f"{look}_"


@pytest.mark.parametrize(
    ("pattern", "reason"),
    [
        ("{look}/{photo}", "File names cannot be"),
        ("../{view}", "File names cannot be"),
        ("/{view}", "File names cannot be"),
        ("render/{view}", "File names cannot be"),
        ("", "File names cannot be"),
        ("{look}", "give two pictures the path 'Recolored'"),
    ],
)
def test_impossible_file_names_are_refused_before_a_job(addon, shot, out, pattern, reason):
    shot.karf.file_names = pattern
    with pytest.raises(addon.engine_api.BadRequest, match=reason):
        addon.steps.render_captured(shot, "all")
    assert not out.exists()


def test_without_a_look_in_the_names_other_swatches_are_refused(addon, shot):
    shot.karf.file_names = "{view}"
    addon.steps.render_captured(shot, "all").wait()
    paint(addon, shot, RED)
    with pytest.raises(addon.engine_api.BadRequest, match="pictures of other swatches"):
        addon.steps.render_captured(shot, "all")
    addon.steps.keep_look(shot)
    with pytest.raises(addon.engine_api.BadRequest, match="the same names"):
        addon.steps.render_looks(shot)


@pytest.mark.parametrize(
    ("views", "numbers"), [("photo_0-photo_1", "01"), ("photo_2 - photo_1", "12"), ("photo_2,photo_0-photo_2", "012")]
)
def test_views_may_be_ranges(bpy, addon, shot, out, views, numbers):
    assert bpy.ops.karf.render_capture(views=views) == {"FINISHED"}
    assert sorted(pictures_in(out)) == [f"Recolored/photo_{number}.png" for number in numbers]


def test_files_of_earlier_versions_still_show_their_frames(addon, shot, out):
    folder = addon.steps.render_captured(shot, "all").wait()
    shot.karf.frames = str(folder)
    assert addon.steps.show_frames(shot).source == "SEQUENCE"


def test_frames_of_a_camera_name_the_look_too(addon, shot, out):
    addon.steps.keep_look(shot, "Warm")
    shot.karf.file_names = "{look}_{view}"
    folder = addon.steps.render_sequence(shot, frames=[3, 4]).wait()
    assert sorted(path.stem for path in folder.glob("*.png")) == ["Warm_frame_0003", "Warm_frame_0004"]
    assert addon.compat.strip_range(addon.steps.add_strip(shot)) == (3, 5)
