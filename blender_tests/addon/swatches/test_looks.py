"""Named looks: whole states of the swatches that flip by a click, and stay as edits do."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

RED, BLUE, GREEN = (0.75, 0.25, 0.25), (0.25, 0.5, 0.75), (0.25, 0.75, 0.5)


def color_of(scene, name, index):
    return tuple(scene.karf.objects[name].swatches[index].color)


def all_colors(addon, scene):
    return {item.name: addon.colors.edited(item).tolist() for item in scene.karf.objects}


@pytest.fixture
def two(bpy, addon, learned):
    """Look A is as learned, B has a blue pot; B is in use."""
    bpy.ops.karf.keep_look()
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    bpy.ops.karf.keep_look()
    return learned


def test_looks_are_called_by_letters_and_the_last_one_kept_is_in_use(two):
    assert two.karf.looks.keys() == ["A", "B"] and two.karf.look == "B"


def test_choosing_a_look_brings_all_swatches_and_the_picture_at_once(bpy, addon, two):
    blue = addon.displayed.of(two).edited().copy()
    bpy.ops.karf.choose_look(name="A")
    for item in two.karf.objects:
        np.testing.assert_array_equal(addon.colors.edited(item), addon.colors.learned(item))
    assert not np.array_equal(addon.displayed.of(two).edited(), blue)
    bpy.ops.karf.choose_look(name="B")
    np.testing.assert_array_equal(addon.displayed.of(two).edited(), blue)


def test_a_look_is_one_new_picture_and_one_step_to_undo(bpy, addon, two, monkeypatch):
    made = []
    recolor = addon.displayed.DisplayedScene.recolor
    monkeypatch.setattr(addon.displayed.DisplayedScene, "recolor", lambda self: made.append(1) or recolor(self))
    bpy.ops.karf.choose_look(name="A")
    assert len(made) == 1
    assert {"REGISTER", "UNDO"} <= bpy.types.KARF_OT_choose_look.bl_options


def test_locked_and_merged_swatches_are_of_the_look_too_and_others_do_not_follow(bpy, addon, two):
    lid = two.karf.objects["lid"].swatches
    addon.steps.link_swatches(two, ("lid", 1), ("pot", 1))
    addon.steps.merge_swatch(two, "lid", 2, 1)
    lid[2].locked = lid[1].locked = True
    wanted = json.loads(two.karf.looks["A"].edit)["objects"]
    bpy.ops.karf.choose_look(name="A")
    for name, entry in wanted.items():
        np.testing.assert_allclose(addon.colors.edited(two.karf.objects[name]), entry["colors"], atol=1e-6)
    assert lid[1].locked and lid[2].merged == 1


def test_added_colors_come_and_go_with_their_look(bpy, addon, two):
    number = addon.steps.add_color(two, "pot", color_of(two, "pot", 2), GREEN)
    two.karf.objects["pot"].swatches[number].locked = True
    with_added = all_colors(addon, two)
    addon.steps.keep_look(two, "green")
    bpy.ops.karf.choose_look(name="A")
    assert not addon.colors.added(two.karf.objects["pot"])
    bpy.ops.karf.choose_look(name="green")
    assert all_colors(addon, two) == with_added


def test_edges_of_objects_are_of_the_look_too(bpy, addon, two):
    two.karf.objects["pot"].feather = 4.0
    assert addon.looks.is_changed(two)
    addon.steps.keep_look(two, "soft")
    bpy.ops.karf.choose_look(name="A")
    assert two.karf.objects["pot"].feather == 0
    bpy.ops.karf.flip_looks()
    assert two.karf.objects["pot"].feather == 4.0


def test_a_look_is_marked_once_the_swatches_have_moved_on(bpy, addon, two):
    assert not addon.looks.is_changed(two)
    addon.steps.set_swatch(two, "pot", 1, RED)
    assert addon.looks.is_changed(two)
    bpy.ops.karf.keep_look(name="B")
    assert not addon.looks.is_changed(two)
    bpy.ops.karf.choose_look(name="A")
    bpy.ops.karf.choose_look(name="B")
    np.testing.assert_allclose(color_of(two, "pot", 1), RED)


def test_flipping_goes_back_and_forth_between_the_last_two(bpy, addon, two):
    addon.steps.keep_look(two, "C")
    bpy.ops.karf.choose_look(name="A")
    used = []
    for _ in range(3):
        bpy.ops.karf.flip_looks()
        used.append(two.karf.look)
    assert used == ["C", "A", "C"]
    bpy.ops.karf.remove_look(name="A")
    bpy.ops.karf.flip_looks()
    assert two.karf.look == "B"  # the other one is gone: the next of the list


def test_the_key_flips_over_the_recolored_picture_alone(bpy, addon, two):
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "IMAGE_EDITOR"
    region = next(each for each in area.regions if each.type == "WINDOW")
    button = SimpleNamespace(execute=lambda context: "flipped")
    for image, result in ((bpy.data.images.new("other", 8, 8), {"PASS_THROUGH"}), (two.karf.result, "flipped")):
        area.spaces.active.image = image
        with bpy.context.temp_override(window=window, area=area, region=region):
            assert bpy.types.KARF_OT_flip_looks.invoke(button, bpy.context, None) == result


def test_all_sidebars_show_what_was_done_to_looks(bpy, addon, two, monkeypatch):
    drawn = []
    monkeypatch.setattr(addon.windows, "redraw_sidebars", lambda: drawn.append(two.karf.look))
    bpy.ops.karf.choose_look(name="A")
    bpy.ops.karf.flip_looks()
    bpy.ops.karf.keep_look()
    assert drawn == ["A", "B", "C"]


def test_leaving_a_changed_look_says_that_undo_brings_it_back(bpy, addon, two, capfd):
    addon.steps.set_swatch(two, "pot", 1, RED)
    bpy.ops.karf.flip_looks()
    assert "B had changed since you kept it: undo restores the changes" in capfd.readouterr().out


def test_looks_are_renamed_moved_and_removed(bpy, addon, two):
    bpy.ops.karf.rename_look(name="B", new="Winter")
    assert two.karf.looks.keys() == ["A", "Winter"] and two.karf.look == "Winter"
    bpy.ops.karf.move_look(name="Winter", by=-1)
    assert two.karf.looks.keys() == ["Winter", "A"]
    bpy.ops.karf.move_look(name="Winter", by=-1)
    assert two.karf.looks.keys() == ["Winter", "A"]
    before = all_colors(addon, two)
    bpy.ops.karf.remove_look(name="Winter")
    assert two.karf.looks.keys() == ["A"] and all_colors(addon, two) == before
    assert not bpy.ops.karf.flip_looks.poll() or two.karf.look != "A"


@pytest.mark.parametrize(
    ("new", "sentence"), [("", "empty"), ("a", "use the same folder"), ("A", "use the same folder")]
)
def test_a_name_must_be_a_folder_of_its_own(bpy, two, new, sentence):
    with pytest.raises(RuntimeError, match=sentence):
        bpy.ops.karf.rename_look(name="B", new=new)
    assert two.karf.looks.keys() == ["A", "B"]


def test_looks_wait_for_palettes(bpy, learned):
    learned.karf.objects.clear()
    assert not bpy.ops.karf.keep_look.poll() and not bpy.ops.karf.render_looks.poll()


def test_looks_are_in_the_file(bpy, addon, two, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "pots.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "pots.blend"))
    scene = bpy.context.scene
    assert scene.karf.looks.keys() == ["A", "B"] and scene.karf.look == "B" and not addon.looks.is_changed(scene)
    bpy.ops.karf.flip_looks()
    assert scene.karf.look == "A"


# --- palettes learned anew -------------------------------------------------------------------------------------------
def palettes(addon, **colors):
    make = addon.engine_api.Palette
    return [make(name, np.array([(0, 0, 0), *rows], np.float32)) for name, rows in colors.items()]


def test_looks_follow_their_object_and_color_when_palettes_are_learned_anew(addon, two):
    pot = addon.colors.learned(two.karf.objects["pot"])[1:].tolist()
    addon.steps.set_swatch(two, "pot", 1, RED)  # the swatches themselves are of no look
    moved = [pot[1], (0.1, 0.8, 0.1), [value * 0.99 for value in pot[0]]]
    addon.palettes.load_palettes(two, palettes(addon, pot=moved, new=[(0, 0, 1)]))
    np.testing.assert_allclose(color_of(two, "pot", 3), RED)
    assert two.karf.look == "B" and addon.looks.is_changed(two)
    addon.steps.choose_look(two, "B")
    np.testing.assert_allclose(color_of(two, "pot", 3), BLUE)
    np.testing.assert_allclose(color_of(two, "pot", 2), (0.1, 0.8, 0.1))  # new: as learned
    addon.steps.choose_look(two, "A")
    np.testing.assert_allclose(color_of(two, "pot", 3), moved[2], atol=1e-6)


def test_a_look_whose_colors_are_gone_is_kept_as_a_file(addon, two):
    wanted = json.loads(two.karf.looks["B"].edit)
    addon.steps.choose_look(two, "A")
    addon.palettes.load_palettes(two, palettes(addon, lid=[(0.2, 0.4, 0.6), (1, 1, 1)]))
    (file,) = (addon.folders.project_of(two).folder / "edits").glob("kept-*-B.json")
    assert json.loads(file.read_text()) == wanted
    assert str(file) in addon.progress.state().warnings and "look B" in addon.progress.state().warnings
    assert two.karf.looks.keys() == ["A", "B"]
    addon.steps.choose_look(two, "B")


def test_without_objects_there_are_no_looks(addon, two):
    addon.palettes.load_palettes(two, ())
    assert not len(two.karf.looks) and not two.karf.look


@pytest.mark.parametrize("text", ["{", "[" * 100_000])
def test_a_spoiled_look_says_so_and_changes_nothing(bpy, addon, two, text):
    before = all_colors(addon, two)
    two.karf.looks["A"].edit = text
    with pytest.raises(RuntimeError, match="The look 'A' is not a valid edit"):
        bpy.ops.karf.choose_look(name="A")
    assert all_colors(addon, two) == before


# --- rendered --------------------------------------------------------------------------------------------------------
def test_every_look_is_rendered_in_every_view_in_a_folder_of_its_own(bpy, addon, two):
    assert bpy.ops.karf.render_looks(views="photo_0,photo_2") == {"FINISHED"}
    folder = addon.steps.looks_folder(two)
    assert sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.png")) == [
        "A/photo_0.png",
        "A/photo_2.png",
        "B/photo_0.png",
        "B/photo_2.png",
    ]
    rows = json.loads((folder / "looks.json").read_text())
    assert [row["colorway"] for row in rows] == ["A", "B"]
    assert json.loads((folder / rows[1]["edit"]).read_text()) == json.loads(two.karf.looks["B"].edit)


def test_a_camera_is_rendered_in_every_look(bpy, addon, two, monkeypatch):
    two.frame_start, two.frame_end = 1, 2
    two.camera = next(each for each in bpy.data.objects if each.type == "CAMERA")
    bpy.ops.karf.render_looks(what="CAMERA")
    folder = addon.steps.looks_folder(two, of_camera=True)
    assert sorted(path.relative_to(folder).as_posix() for path in folder.glob("*/*.png")) == [
        "A/frame_0001.png",
        "A/frame_0002.png",
        "B/frame_0001.png",
        "B/frame_0002.png",
    ]
