"""All swatch edits survive saved files, edit files, looks, palette extraction and keyframes."""

import numpy as np
import pytest

from ..saved_files import everything_stored
from .scenes import BLUE, GREEN, YELLOW, pixels, show_block, show_halves

PINK = (0.7, 0.3, 0.4)


@pytest.fixture
def edited(addon, learned, tmp_path):
    """The scene after every kind of edit; learned.json has the state before."""
    show_halves(addon, learned)
    karf, pot, lid = addon.steps, learned.karf.objects["pot"], learned.karf.objects["lid"]
    karf.save_edit(learned, tmp_path / "learned.json")
    karf.add_color(learned, "pot", YELLOW, BLUE, reach=0.75, protect=0.25)
    karf.merge_swatch(learned, "pot", 2, 1)
    karf.set_swatch(learned, "pot", 1, GREEN)
    karf.set_surface(learned, "lid", 1, saturation=0.25, brightness=0.5, gloss=1.5)
    lid.swatches[2].locked, pot.target = True, YELLOW
    pot.choke, pot.feather, lid.feather = -1.5, 4, 3
    learned.karf.compositing = "paper"
    return learned


def test_saved_file_keeps_edits_and_picture_without_the_project(bpy, addon, edited, tmp_path):
    addon.steps.link_swatches(edited, ("lid", 1), ("pot", 1))
    for name in ("A", "B"):
        addon.steps.keep_look(edited, name)
    addon.steps.show_view(edited, "photo_2").wait()
    stored, shown = everything_stored(edited.karf), pixels(addon, edited)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    for is_gone in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
        scene = bpy.context.scene
        assert everything_stored(scene.karf) == stored
        np.testing.assert_array_equal(pixels(addon, scene), shown)
        assert scene.karf.looks.keys() == ["A", "B"] and not addon.looks.is_changed(scene)
        if not is_gone:
            addon.steps.apply_edit(scene, tmp_path / "learned.json")
            assert np.abs(pixels(addon, scene) - shown).max() > 0.1  # it still recolors
            addon.disk.planes_file(scene).unlink()


def test_edit_file_and_look_restore_the_shown_state(addon, edited, tmp_path):
    karf, file, same = addon.steps, tmp_path / "edit.json", tmp_path / "same.json"
    wanted, shown = addon.edits.edit_option(edited), pixels(addon, edited)
    karf.save_edit(edited, file)
    karf.keep_look(edited, "kept")
    for restore in (lambda: karf.apply_edit(edited, file), lambda: karf.choose_look(edited, "kept")):
        karf.apply_edit(edited, tmp_path / "learned.json")
        assert addon.edits.edit_option(edited) != wanted and (pixels(addon, edited) != shown).any()
        restore()
        assert addon.edits.edit_option(edited) == wanted
        np.testing.assert_array_equal(pixels(addon, edited), shown)
        karf.save_edit(edited, same)
        assert same.read_text() == file.read_text()


def test_loading_palettes_again_keeps_everything(addon, edited):
    addon.steps.link_swatches(edited, ("lid", 1), ("pot", 1))
    stored = everything_stored(edited.karf)
    addon.palettes.load_palettes(edited, addon.colors.palettes(edited))
    assert everything_stored(edited.karf) == stored


FRAMES = {  # keyframed property of the pot: its picture, its second value
    "swatches[1].color": (show_halves, BLUE),
    "swatches[3].color": (show_halves, BLUE),  # the added color
    "swatches[1].saturation": (show_halves, 0.0),
    "swatches[1].brightness": (show_halves, 0.5),
    "choke": (show_block, 2.0),
    "feather": (show_block, 4.0),
}


@pytest.mark.parametrize("path", FRAMES)
def test_keyframes_move_the_palette_and_the_picture(addon, learned, path):
    show_picture, value = FRAMES[path]
    show_picture(addon, learned)
    addon.steps.add_color(learned, "pot", YELLOW, GREEN)
    addon.steps.set_swatch(learned, "pot", 1, PINK)
    pot, found = learned.karf.objects["pot"], {}
    owner, _, name = path.rpartition(".")
    owner = pot.path_resolve(owner) if owner else pot
    for frame, given in ((1, getattr(owner, name)), (11, value)):
        learned.frame_set(frame)
        setattr(owner, name, given)
        owner.keyframe_insert(name, frame=frame)
        found[frame] = addon.colors.edited(pot), pixels(addon, learned)
    assert np.abs(found[1][1] - found[11][1]).max() > 0.05
    for frame, (palette, shown) in found.items():
        learned.frame_set(frame)
        np.testing.assert_allclose(addon.colors.edited(pot), palette, atol=1e-6)
        np.testing.assert_array_equal(pixels(addon, learned), shown)
    learned.frame_set(6)
    assert all(np.abs(pixels(addon, learned) - shown).max() > 0.02 for _, shown in found.values())


def test_keyframes_also_move_linked_and_merged_swatches(addon, learned):
    addon.steps.link_swatches(learned, ("lid", 1), ("pot", 1))
    addon.steps.merge_swatch(learned, "pot", 2, 1)
    pot, lid = learned.karf.objects["pot"], learned.karf.objects["lid"]
    pot.swatches[1].keyframe_insert("color", frame=1)
    pot.swatches[1].color = (0.6, 0.3, 0.2)
    pot.swatches[1].keyframe_insert("color", frame=11)
    for frame, moved in ((1, 0), (11, (-0.2, 0.1, 0.1))):
        learned.frame_set(frame)
        for swatch, start in ((lid.swatches[1], (0.8, 0.2, 0.1)), (pot.swatches[2], (0.9, 0.9, 0.5))):
            np.testing.assert_allclose(swatch.color, np.add(start, moved), atol=1e-6)
