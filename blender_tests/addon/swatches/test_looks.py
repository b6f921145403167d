"""Named looks: whole swatch states that a click switches between."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from .scenes import BLUE, GREEN, RED, color, pixels


@pytest.fixture
def two(bpy, addon, learned):
    """Look A as learned, and look B with a blue pot, which is in use."""
    bpy.ops.karf.keep_look()
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    bpy.ops.karf.keep_look()
    return learned


def test_choosing_a_look_recolors_once_as_one_undo_step(bpy, addon, two, monkeypatch):
    assert two.karf.looks.keys() == ["A", "B"] and two.karf.look == "B"
    blue, made = pixels(addon, two), []
    recolor = addon.displayed.DisplayedScene.recolor
    monkeypatch.setattr(addon.displayed.DisplayedScene, "recolor", lambda self: made.append(1) or recolor(self))
    bpy.ops.karf.choose_look(name="A")
    assert len(made) == 1 and {"REGISTER", "UNDO"} <= bpy.types.KARF_OT_choose_look.bl_options
    for item in two.karf.objects:
        np.testing.assert_array_equal(addon.colors.edited(item), addon.colors.learned(item))
    assert not np.array_equal(pixels(addon, two), blue)
    bpy.ops.karf.choose_look(name="B")
    np.testing.assert_array_equal(pixels(addon, two), blue)


def test_looks_keep_locked_merged_and_added_swatches(bpy, addon, two):
    pot, lid = two.karf.objects["pot"], two.karf.objects["lid"].swatches
    wanted = json.loads(two.karf.looks["A"].edit)["objects"]
    addon.steps.link_swatches(two, ("lid", 1), ("pot", 1))
    addon.steps.merge_swatch(two, "lid", 2, 1)
    pot.swatches[addon.steps.add_color(two, "pot", color(two, "pot", 2), GREEN)].locked = True
    lid[2].locked = lid[1].locked = True
    with_added = addon.edits.edit_option(two)
    addon.steps.keep_look(two, "green")
    bpy.ops.karf.choose_look(name="A")
    for name, entry in wanted.items():
        np.testing.assert_allclose(addon.colors.edited(two.karf.objects[name]), entry["colors"], atol=1e-6)
    assert lid[1].locked and lid[2].merged == 1 and not addon.colors.added(pot)
    bpy.ops.karf.choose_look(name="green")
    assert addon.edits.edit_option(two) == with_added


def test_look_counts_as_changed_after_any_edit(bpy, addon, two, capfd):
    assert not addon.looks.is_changed(two)
    two.karf.objects["pot"].feather = 4.0
    assert addon.looks.is_changed(two)
    bpy.ops.karf.keep_look(name="B")
    assert not addon.looks.is_changed(two)
    bpy.ops.karf.flip_looks()
    assert two.karf.objects["pot"].feather == 0
    bpy.ops.karf.flip_looks()
    assert two.karf.objects["pot"].feather == 4.0
    addon.steps.set_swatch(two, "pot", 1, RED)
    bpy.ops.karf.flip_looks()
    assert "B had changed since you kept it: undo restores the changes" in capfd.readouterr().out


def test_flip_switches_the_last_two_looks_and_redraws_sidebars(bpy, addon, two, monkeypatch):
    drawn = []
    monkeypatch.setattr(addon.windows, "redraw_sidebars", lambda: drawn.append(two.karf.look))
    bpy.ops.karf.keep_look()
    bpy.ops.karf.choose_look(name="A")
    for _ in range(3):
        bpy.ops.karf.flip_looks()
    assert drawn == ["C", "A", "C", "A", "C"]
    bpy.ops.karf.remove_look(name="A")
    bpy.ops.karf.flip_looks()
    assert two.karf.look == "B"  # the previous look is gone: the next in the list


def test_key_flips_looks_only_over_the_recolored_picture(bpy, two, image_editor):
    window = bpy.context.window_manager.windows[0]
    region = next(each for each in image_editor.regions if each.type == "WINDOW")
    button = SimpleNamespace(execute=lambda context: "flipped")
    for image, result in ((bpy.data.images.new("other", 8, 8), {"PASS_THROUGH"}), (two.karf.result, "flipped")):
        image_editor.spaces.active.image = image
        with bpy.context.temp_override(window=window, area=image_editor, region=region):
            assert bpy.types.KARF_OT_flip_looks.invoke(button, bpy.context, None) == result


def test_looks_can_be_renamed_moved_and_removed(bpy, addon, two):
    for new, reason in (("", "empty"), ("a", "use the same folder"), ("A", "use the same folder")):
        with pytest.raises(RuntimeError, match=reason):
            bpy.ops.karf.rename_look(name="B", new=new)
    assert two.karf.looks.keys() == ["A", "B"] and two.karf.look == "B"
    bpy.ops.karf.rename_look(name="B", new="Winter")
    assert two.karf.looks.keys() == ["A", "Winter"] and two.karf.look == "Winter"
    for _ in range(2):
        bpy.ops.karf.move_look(name="Winter", by=-1)
        assert two.karf.looks.keys() == ["Winter", "A"]
    before = addon.edits.edit_option(two)
    bpy.ops.karf.remove_look(name="Winter")
    assert two.karf.looks.keys() == ["A"] and addon.edits.edit_option(two) == before
    assert not bpy.ops.karf.flip_looks.poll() or two.karf.look != "A"
    two.karf.objects.clear()
    assert not bpy.ops.karf.keep_look.poll() and not bpy.ops.karf.render_looks.poll()


@pytest.mark.parametrize("text", ["{", "[" * 100_000])
def test_damaged_look_is_rejected_and_changes_nothing(bpy, addon, two, text):
    before = addon.edits.edit_option(two)
    two.karf.looks["A"].edit = text
    with pytest.raises(RuntimeError, match="The look 'A' is not a valid edit"):
        bpy.ops.karf.choose_look(name="A")
    assert addon.edits.edit_option(two) == before


@pytest.mark.parametrize("is_camera", [False, True])
def test_each_look_is_rendered_to_its_own_folder(bpy, addon, two, is_camera):
    two.frame_start, two.frame_end = 1, 2
    options = {"what": "CAMERA"} if is_camera else {"views": "photo_0,photo_2"}
    assert bpy.ops.karf.render_looks(**options) == {"FINISHED"}
    folder = addon.steps.looks_folder(two, of_camera=is_camera)
    wanted = ("frame_0001", "frame_0002") if is_camera else ("photo_0", "photo_2")
    found = sorted(path.relative_to(folder).as_posix() for path in folder.glob("*/*.png"))
    assert found == [f"{look}/{name}.png" for look in "AB" for name in wanted]
    if not is_camera:
        rows = json.loads((folder / "looks.json").read_text())
        assert [row["colorway"] for row in rows] == ["A", "B"]
        assert json.loads((folder / rows[1]["edit"]).read_text()) == json.loads(two.karf.looks["B"].edit)
