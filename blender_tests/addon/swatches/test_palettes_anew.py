"""Loading new palettes keeps edits, looks, locks and keyframes with their object and color."""

import json

import numpy as np
import pytest

from .scenes import LID, POT, color, palettes

BLUE = (0.25, 0.5, 0.75)
GREEN = (0.1, 0.8, 0.1)


@pytest.fixture
def blue(addon, learned):
    """The scene with an edit."""
    addon.steps.set_swatch(learned, "pot", 1, BLUE)
    return learned


def load(addon, scene, **objects):
    addon.palettes.load_palettes(scene, palettes(addon, **objects))


def keyframe_swatch(scene, name, index):
    """Keyframe a swatch from black at frame 1 to white at frame 11."""
    swatch = scene.karf.objects[name].swatches[index]
    for frame, value in ((1, 0.0), (11, 1.0)):
        swatch.color = (value,) * 3
        swatch.keyframe_insert("color", frame=frame)


def color_at_frame_6(scene, name, index):
    for frame in (11, 6):
        scene.frame_set(frame)
    return color(scene, name, index)


def kept_files(addon, scene):
    return sorted((addon.folders.project_of(scene).folder / "edits").glob("kept-*.json"))


def test_extracting_palettes_again_keeps_edits_locks_and_targets(addon, blue):
    lid, pot = blue.karf.objects
    lid.swatches[2].locked, pot.target = True, BLUE
    addon.steps.extract_palette(blue).wait()
    lid, pot = blue.karf.objects
    np.testing.assert_array_equal([pot.swatches[1].color, pot.target], [BLUE] * 2)
    assert lid.swatches[2].locked and not kept_files(addon, blue)


def test_edits_and_looks_follow_reordered_objects_and_colors(addon, blue):
    addon.steps.keep_look(blue, "blue")
    addon.steps.set_swatch(blue, "pot", 1, GREEN)  # in no look
    swatch = blue.karf.objects["pot"].swatches[2]
    swatch.locked, swatch.saturation = True, 0.25
    load(addon, blue, new=[(0, 0, 1)], pot=[POT[1], GREEN, (0.82, 0.19, 0.12)], lid=LID)
    np.testing.assert_allclose(color(blue, "pot", 3), GREEN)
    swatches = [(swatch.locked, swatch.saturation) for swatch in blue.karf.objects["pot"].swatches]
    assert swatches == [(True, 1), (True, 0.25), (False, 1), (False, 1)]
    assert not kept_files(addon, blue)
    assert blue.karf.look == "blue" and addon.looks.is_changed(blue)
    addon.steps.choose_look(blue, "blue")
    np.testing.assert_allclose(color(blue, "pot", 3), BLUE)
    np.testing.assert_allclose(color(blue, "pot", 2), GREEN)  # a new color stays as learned


def test_edits_of_lost_colors_are_saved_to_files(addon, blue):
    addon.steps.keep_look(blue, "B")
    wanted = json.loads(blue.karf.looks["B"].edit)
    addon.steps.set_swatch(blue, "pot", 1, GREEN)
    load(addon, blue, lid=LID, pot=[(0.1, 0.1, 0.9), POT[1]])
    np.testing.assert_allclose(color(blue, "pot", 1), (0.1, 0.1, 0.9))
    edit, look = sorted(kept_files(addon, blue), key=lambda path: path.stem.endswith("-B"))
    np.testing.assert_allclose(json.loads(edit.read_text())["objects"]["pot"]["colors"][1], GREEN, atol=1e-6)
    assert json.loads(look.read_text()) == wanted
    warnings = addon.progress.state().warnings
    assert str(edit) in warnings and str(look) in warnings and "look B" in warnings
    addon.steps.choose_look(blue, "B")
    addon.palettes.load_palettes(blue, ())
    assert not len(blue.karf.looks) and not blue.karf.look


def test_keyframes_and_drivers_follow_their_swatch(addon, learned):
    keyframe_swatch(learned, "lid", 2)
    curve = learned.driver_add("karf.objects[1].swatches[1].color", 0)
    curve.driver.type, curve.driver.expression = "SCRIPTED", "frame / 10"
    load(addon, learned, box=LID, pot=POT, lid=LID[::-1])
    np.testing.assert_allclose(color_at_frame_6(learned, "lid", 1), 0.5, atol=1e-4)
    np.testing.assert_allclose([color(learned, "box", 2), color(learned, "lid", 2)], [(1, 1, 1), LID[0]])
    learned.frame_set(5)
    assert color(learned, "pot", 1)[0] == pytest.approx(0.5)


def test_keyframes_and_drivers_wait_for_a_missing_object(addon, learned):
    keyframe_swatch(learned, "lid", 2)
    curve = learned.driver_add('karf.objects["lid"].swatches[1].color', 0)
    for _ in range(2):
        load(addon, learned, pot=POT)
        np.testing.assert_allclose(color_at_frame_6(learned, "pot", 2), POT[1])
    load(addon, learned, pot=POT, lid=[(0.5, 0, 0.5), *LID])
    np.testing.assert_allclose(color_at_frame_6(learned, "lid", 3), 0.5, atol=1e-4)
    assert curve.data_path == "karf.objects[1].swatches[2].color"


def test_checking_for_edits_changes_nothing(addon, learned):
    assert not addon.palettes.has_edits(learned)
    learned.driver_add("karf.objects[1].swatches[1].color", 0)
    assert addon.palettes.has_edits(learned)
    keyframe_swatch(learned, "lid", 2)
    addon.steps.apply_edit(learned, addon.engine_api.Edit({}, "delta"))
    other, action = learned.copy(), learned.animation_data.action
    assert addon.palettes.has_edits(learned) and addon.palettes.has_edits(other)
    assert other.animation_data.action == learned.animation_data.action == action


def test_scenes_sharing_an_action_keep_their_keyframes(addon, learned):
    keyframe_swatch(learned, "lid", 2)
    scenes = learned, learned.copy()
    assert scenes[0].animation_data.action == scenes[1].animation_data.action
    for scene in scenes:
        load(addon, scene, pot=POT, lid=LID)
    for scene in scenes:
        curves = addon.compat.curves_of(scene.animation_data)
        assert {curve.data_path for curve in curves} == {"karf.objects[1].swatches[2].color"}


def test_edits_stay_when_palettes_cannot_be_replaced(addon, blue, capsys):
    (addon.folders.project_of(blue).folder / "edits").write_text("in the way")
    with pytest.raises(addon.engine_api.DataError, match="could not be saved"):
        load(addon, blue, lid=LID)
    np.testing.assert_array_equal(color(blue, "pot", 1), BLUE)
    blue.karf.project = blue.karf.project + "/../project"
    np.testing.assert_array_equal(color(blue, "pot", 1), BLUE)
    addon.folders.project_of(blue).palette_file.write_text("{")
    blue.karf.project = blue.karf.project
    np.testing.assert_array_equal(color(blue, "pot", 1), BLUE)
    assert addon.progress.state().warnings.count("broken JSON") == 1
    assert "Traceback" not in capsys.readouterr().out


def test_choosing_another_project_saves_edits_it_cannot_show(addon, blue, tmp_path):
    addon.steps.set_swatch(blue, "lid", 1, BLUE)
    content = {"schema": "karf-palette/1", "objects": [{"name": "lid", "colors": [[0, 0, 0], *LID]}]}
    other = addon.engine_api.Project(tmp_path / "other")
    other.create("lids")
    other.palette_file.write_text(json.dumps(content))
    blue.karf.project = str(other.folder)
    assert blue.karf.objects.keys() == ["lid"]
    np.testing.assert_array_equal(color(blue, "lid", 1), BLUE)
    (file,) = kept_files(addon, blue)
    assert json.loads(file.read_text())["objects"]["pot"]["colors"][1] == list(BLUE)


def test_showing_a_view_reloads_palettes_and_tooltip_mentions_kept_edits(bpy, addon, learned):
    load(addon, learned, lid=LID)
    addon.steps.show_view(learned).wait()
    assert learned.karf.objects.keys() == ["lid", "pot"]
    tooltip = bpy.ops.karf.extract_palette.get_rna_type().description
    assert "given up" not in tooltip and "kept" in tooltip


def test_importing_another_capture_saves_the_edits(addon, blue, two_splits, tmp_path):
    project = addon.folders.project_of(blue)
    addon.steps.import_capture(blue, two_splits, tmp_path / "second")
    assert not blue.karf.objects and len(list((project.folder / "edits").glob("kept-*.json"))) == 1
