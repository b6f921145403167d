"""Everything that was done to swatches survives files, looks, palettes found anew and frames."""

import numpy as np
import pytest

from ..saved_files import everything_stored
from .scenes import BLUE, GREEN, YELLOW, pixels, show_block, show_halves

PINK = (0.7, 0.3, 0.4)


@pytest.fixture
def edited(addon, pots, tmp_path):
    """The scene after every kind of edit; learned.json has what it was."""
    karf = addon.steps
    karf.save_edit(pots, tmp_path / "learned.json")
    karf.add_color(pots, "pot", YELLOW, BLUE, reach=0.75, protect=0.25)
    karf.merge_swatch(pots, "pot", 2, 1)
    karf.set_swatch(pots, "pot", 1, GREEN)
    karf.set_surface(pots, "lid", 1, saturation=0.25, brightness=0.5, gloss=1.5)
    pot, lid = pots.karf.objects["pot"], pots.karf.objects["lid"]
    lid.swatches[2].locked, pot.target = True, YELLOW
    pot.choke, pot.feather, lid.feather = -1.5, 4, 3
    pots.karf.compositing = "paper"
    return pots


def test_a_saved_file_keeps_everything_and_its_picture_without_the_project(bpy, addon, edited, tmp_path):
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
            assert np.abs(pixels(addon, scene) - shown).max() > 0.1  # it goes on
            addon.disk.planes_file(scene).unlink()


def by_file(addon, scene, folder):
    addon.steps.save_edit(scene, folder / "edit.json")
    addon.steps.apply_edit(scene, folder / "learned.json")
    yield
    addon.steps.apply_edit(scene, folder / "edit.json")
    yield
    addon.steps.save_edit(scene, folder / "same.json")
    assert (folder / "same.json").read_text() == (folder / "edit.json").read_text()


def by_look(addon, scene, folder):
    addon.steps.keep_look(scene, "kept")
    addon.steps.apply_edit(scene, folder / "learned.json")
    yield
    addon.steps.choose_look(scene, "kept")
    yield


@pytest.mark.parametrize("way", [by_file, by_look])
def test_an_edit_file_and_a_look_bring_the_shown_state_back(addon, edited, tmp_path, way):
    wanted, shown = addon.edits.edit_option(edited), pixels(addon, edited)
    for is_back, _ in zip((False, True), steps := way(addon, edited, tmp_path), strict=False):
        assert (addon.edits.edit_option(edited) == wanted) == is_back
        np.testing.assert_array_equal((pixels(addon, edited) == shown).all(), is_back)
    assert list(steps) == []


def test_palettes_found_again_leave_everything(addon, edited):
    addon.steps.link_swatches(edited, ("lid", 1), ("pot", 1))
    stored = everything_stored(edited.karf)
    addon.palettes.load_palettes(edited, addon.colors.palettes(edited))
    assert everything_stored(edited.karf) == stored


FRAMES = {  # what is keyframed of the pot -> the picture, the second value
    "swatches[1].color": (show_halves, BLUE),
    "swatches[3].color": (show_halves, BLUE),  # added
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


def test_keyframes_of_one_swatch_move_those_that_are_linked_and_merged(addon, learned):
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
