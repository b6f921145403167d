"""Which scene's picture the Image Editors show, without a click."""

import numpy as np
import pytest


@pytest.fixture
def editor(bpy, addon, learned):
    """A question: the picture in the Image Editor of the window."""
    window = bpy.data.window_managers[0].windows[0]
    window.screen.areas[0].type = "IMAGE_EDITOR"

    def space():
        window = bpy.data.window_managers[0].windows[0]
        return next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR").spaces.active

    space().image = learned.karf.result
    return space


def test_a_file_that_is_opened_shows_its_picture(bpy, addon, learned, editor, tmp_path):
    editor().image = None
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "pots.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "pots.blend"))
    assert editor().image == bpy.context.scene.karf.result is not None


def test_a_preview_that_is_gone_is_no_picture(bpy, addon, learned, editor):
    editor().image = gone = _gone(bpy)
    addon.following.show_again()
    assert editor().image == learned.karf.result != gone


def _gone(bpy):
    image = bpy.data.images.new("KaRF preview", 1, 1)
    image.source, image.filepath = "FILE", "/nowhere/preview.png"
    return image


def test_a_picture_of_the_artists_own_stays(bpy, addon, learned, editor):
    editor().image = own = bpy.data.images.new("sketch", 8, 8)
    addon.following.show_again()
    addon.following.show_own()
    assert editor().image == own


def test_another_scene_shows_its_own_picture_and_not_the_first_ones(bpy, addon, learned, editor):
    window, other = bpy.data.window_managers[0].windows[0], bpy.data.scenes.new("other")
    window.scene = other
    addon.following.show_own()
    assert editor().image is None
    window.scene = learned
    addon.following.show_own()
    assert editor().image == learned.karf.result
    other.karf.result = addon.images.new_image("KaRF", 8, 8)
    window.scene = other
    addon.following.show_own()
    assert editor().image == other.karf.result
    window.scene = learned
    addon.following.show_own()
    assert editor().image == learned.karf.result


# --- undo across a job: what was learned stays learned ---------------------------------------------------------------
def learned_colors(scene):
    return {item.name: [tuple(swatch.learned) for swatch in item.swatches] for item in scene.karf.objects}


def test_undo_across_the_first_palettes_keeps_swatches_and_picture(bpy, addon, project_scene):
    window = bpy.data.window_managers[0].windows[0]
    window.screen.areas[0].type = "IMAGE_EDITOR"
    addon.steps.learn_scene(project_scene).wait()
    bpy.ops.ed.undo_push(message="begin")
    addon.steps.extract_palette(bpy.context.scene).wait()
    before = learned_colors(bpy.context.scene)
    bpy.ops.ed.undo_push(message="Extract Palette")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert learned_colors(scene) == before != {}
    shown = [area.spaces.active.image for area in window.screen.areas if area.type == "IMAGE_EDITOR"]
    assert scene.karf.result is not None and set(shown) == {scene.karf.result}


def test_undo_across_extracting_anew_keeps_the_swatches_that_were_found(bpy, addon, learned):
    api, project = addon.engine_api, addon.folders.project_of(learned)
    bpy.ops.ed.undo_push(message="begin")
    content = api.read_json(project.palette_file, "palettes")
    for each in content["objects"]:
        each["colors"] = [[0, 0, 0], [0.1, 0.9, 0.3], [0.9, 0.9, 0.1]]
    api.write_json(project.palette_file, content)
    project.finish("recoloring", "anew")
    addon.palettes.import_learned(learned)
    found = learned_colors(learned)
    bpy.ops.ed.undo_push(message="Extract Palette")
    bpy.ops.ed.undo()
    assert learned_colors(bpy.context.scene) == found
    np.testing.assert_allclose(found["pot"][1], (0.1, 0.9, 0.3), atol=1e-6)
