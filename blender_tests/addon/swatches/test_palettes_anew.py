"""Palettes found anew: edits, locks and keyframes stay with their object and color, and nothing is lost."""

import json

import numpy as np
import pytest

BLUE = (0.25, 0.5, 0.75)


def palettes(addon, **colors):
    """Palettes of objects by name; black comes before the colors."""
    make = addon.engine_api.Palette
    return [make(name, np.array([(0, 0, 0), *rows], np.float32)) for name, rows in colors.items()]


LID, POT = [(0.2, 0.4, 0.6), (1, 1, 1)], [(0.8, 0.2, 0.1), (0.9, 0.9, 0.5)]


def color_of(scene, name, index):
    return tuple(scene.karf.objects[name].swatches[index].color)


def keyed(scene, name, index):
    """Keyframe a swatch from 0 at frame 1 to 1 at frame 11."""
    swatch = scene.karf.objects[name].swatches[index]
    for frame, value in ((1, 0.0), (11, 1.0)):
        swatch.color = (value,) * 3
        swatch.keyframe_insert("color", frame=frame)


def kept_files(addon, scene):
    return sorted((addon.folders.project_of(scene).folder / "edits").glob("kept-*.json"))


def test_edits_locks_and_pairs_stay_when_palettes_are_extracted_anew(addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    learned.karf.objects["lid"].swatches[2].locked = True
    learned.karf.objects["pot"].target = BLUE
    addon.steps.extract_palette(learned).wait()
    assert color_of(learned, "pot", 1) == BLUE
    assert learned.karf.objects["lid"].swatches[2].locked
    assert tuple(learned.karf.objects["pot"].target) == BLUE
    assert not kept_files(addon, learned)


def test_edits_follow_their_object_and_color_in_another_order(addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    learned.karf.objects["pot"].swatches[2].locked = True
    moved = [POT[1], (0.1, 0.8, 0.1), (0.82, 0.19, 0.12)]
    addon.palettes.load_palettes(learned, palettes(addon, new=[(0, 0, 1)], pot=moved, lid=LID))
    np.testing.assert_allclose(color_of(learned, "pot", 3), BLUE)
    assert [swatch.locked for swatch in learned.karf.objects["pot"].swatches] == [True, True, False, False]
    # what was not edited is as learned now
    np.testing.assert_allclose(color_of(learned, "pot", 2), (0.1, 0.8, 0.1))
    assert not kept_files(addon, learned)


def test_keyframes_stay_with_their_objects_swatch(addon, learned):
    keyed(learned, "lid", 2)
    addon.palettes.load_palettes(learned, palettes(addon, box=LID, lid=LID[::-1], pot=POT))
    learned.frame_set(11)
    learned.frame_set(6)
    np.testing.assert_allclose(color_of(learned, "lid", 1), 0.5, atol=1e-4)
    np.testing.assert_allclose(color_of(learned, "box", 2), 1)
    np.testing.assert_allclose(color_of(learned, "lid", 2), LID[0])


def test_drivers_stay_with_their_objects_swatch(bpy, addon, learned):
    curve = learned.driver_add("karf.objects[1].swatches[1].color", 0)
    curve.driver.type, curve.driver.expression = "SCRIPTED", "frame / 10"
    addon.palettes.load_palettes(learned, palettes(addon, pot=POT, lid=LID))
    learned.frame_set(5)
    assert color_of(learned, "pot", 1)[0] == pytest.approx(0.5)
    assert color_of(learned, "lid", 1) == pytest.approx(LID[0])


def test_keyframes_of_an_object_that_is_gone_move_nothing_and_wait_for_it(addon, learned):
    keyed(learned, "lid", 2)
    addon.palettes.load_palettes(learned, palettes(addon, pot=POT))
    learned.frame_set(6)
    np.testing.assert_allclose(color_of(learned, "pot", 2), POT[1])
    addon.palettes.load_palettes(learned, palettes(addon, pot=POT, lid=[(0.5, 0, 0.5), *LID]))
    learned.frame_set(11)
    learned.frame_set(6)
    np.testing.assert_allclose(color_of(learned, "lid", 3), 0.5, atol=1e-4)
    np.testing.assert_allclose(color_of(learned, "lid", 2), LID[0])


def test_a_driver_that_names_an_object_which_is_gone_disturbs_nothing(addon, learned):
    curve = learned.driver_add('karf.objects["lid"].swatches[1].color', 0)
    for names in (["pot"], ["pot"], ["lid", "pot"]):
        known = {"lid": LID, "pot": POT}
        addon.palettes.load_palettes(learned, palettes(addon, **{name: known[name] for name in names}))
    assert curve.data_path == "karf.objects[0].swatches[1].color"


def test_asking_for_edits_changes_nothing(addon, learned):
    assert not addon.palettes.has_edits(learned)
    keyed(learned, "lid", 2)
    addon.steps.apply_edit(learned, addon.engine_api.Edit({}, "delta"))
    other, action = learned.copy(), learned.animation_data.action
    assert addon.palettes.has_edits(learned) and addon.palettes.has_edits(other)
    assert other.animation_data.action == learned.animation_data.action == action


def test_scenes_that_share_an_action_keep_their_keyframes_each(bpy, addon, learned):
    keyed(learned, "lid", 2)
    other = learned.copy()
    assert other.animation_data.action == learned.animation_data.action
    for scene in (learned, other):
        addon.palettes.load_palettes(scene, palettes(addon, pot=POT, lid=LID))
    for scene in (learned, other):
        curves = addon.compat.curves_of(scene.animation_data)
        assert {curve.data_path for curve in curves} == {"karf.objects[1].swatches[2].color"}


def test_an_edit_whose_color_is_gone_is_kept_in_a_file_that_a_warning_names(bpy, addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    addon.palettes.load_palettes(learned, palettes(addon, lid=LID, pot=[(0.1, 0.1, 0.9), (0.9, 0.9, 0.5)]))
    np.testing.assert_allclose(color_of(learned, "pot", 1), (0.1, 0.1, 0.9))
    (file,) = kept_files(addon, learned)
    assert json.loads(file.read_text())["objects"]["pot"]["colors"][1] == list(BLUE)
    assert str(file) in bpy.context.window_manager.karf_progress.warnings


def test_edits_that_cannot_be_kept_are_not_replaced(bpy, addon, learned):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    project = addon.folders.project_of(learned)
    (project.folder / "edits").write_text("in the way")
    with pytest.raises(addon.engine_api.DataError, match="could not be saved"):
        addon.palettes.load_palettes(learned, palettes(addon, lid=LID))
    assert color_of(learned, "pot", 1) == BLUE


def test_choosing_another_project_keeps_the_edits_that_it_has_no_place_for(addon, learned, tmp_path):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    addon.steps.set_swatch(learned, "lid", 1, BLUE)
    content = {"schema": "karf-palette/1", "objects": [{"name": "lid", "colors": [[0, 0, 0], *LID]}]}
    other = addon.engine_api.Project(tmp_path / "other")
    other.create("lids")
    other.palette_file.write_text(json.dumps(content))
    learned.karf.project = str(other.folder)
    assert learned.karf.objects.keys() == ["lid"] and color_of(learned, "lid", 1) == BLUE
    (file,) = kept_files(addon, learned)
    assert json.loads(file.read_text())["objects"]["pot"]["colors"][1] == list(BLUE)


def test_show_brings_the_palettes_that_the_project_has_learned_meanwhile(addon, learned):
    addon.palettes.load_palettes(learned, palettes(addon, lid=LID))
    addon.steps.show_view(learned).wait()
    assert learned.karf.objects.keys() == ["lid", "pot"]


def test_importing_another_capture_keeps_the_edits(addon, learned, two_splits, tmp_path):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    project = addon.folders.project_of(learned)
    addon.steps.import_capture(learned, two_splits, tmp_path / "second")
    assert not learned.karf.objects
    assert len(list((project.folder / "edits").glob("kept-*.json"))) == 1


def test_a_damaged_palette_leaves_the_swatches_and_warns_once(bpy, addon, learned, capsys):
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    addon.folders.project_of(learned).palette_file.write_text("{")
    learned.karf.project = learned.karf.project
    assert color_of(learned, "pot", 1) == BLUE
    assert bpy.context.window_manager.karf_progress.warnings.count("broken JSON") == 1
    assert "Traceback" not in capsys.readouterr().out


def test_the_button_says_what_becomes_of_edits(bpy, addon):
    tooltip = bpy.ops.karf.extract_palette.get_rna_type().description
    assert "given up" not in tooltip and "kept" in tooltip
