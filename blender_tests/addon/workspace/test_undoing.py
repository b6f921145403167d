"""Undo across a job: what was learned stays learned."""

import numpy as np
import pytest


@pytest.fixture
def editor(bpy, addon):
    """A question: the picture in the Image Editor of the window."""
    window = bpy.data.window_managers[0].windows[0]
    window.screen.areas[0].type = "IMAGE_EDITOR"
    return lambda: next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR").spaces.active.image


def learned_colors(scene):
    return {item.name: [tuple(swatch.learned) for swatch in item.swatches] for item in scene.karf.objects}


def test_undo_across_the_first_palettes_keeps_swatches_and_picture(bpy, addon, project_scene, editor):
    addon.steps.learn_scene(project_scene).wait()
    bpy.ops.ed.undo_push(message="begin")
    addon.steps.extract_palette(bpy.context.scene).wait()
    before = learned_colors(bpy.context.scene)
    bpy.ops.ed.undo_push(message="Extract Palette")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    assert learned_colors(scene) == before != {}
    assert editor() == scene.karf.result is not None


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
