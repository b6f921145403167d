"""What steps ask of the engine, and what they refuse."""

import numpy as np
import pytest


def test_a_pretrained_nerf_goes_along_with_what_is_learned(addon, project_scene, tmp_path):
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] is None
    project_scene.karf.nerf = str(tmp_path / "200000.tar")
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] == str(tmp_path / "200000.tar")


def test_steps_out_of_order_are_refused_in_words(bpy, addon, scene):
    assert not bpy.ops.karf.learn_scene.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="no capture"):
        addon.steps.learn_scene(scene).wait()
    with pytest.raises(addon.engine_api.BadRequest, match="No masks"):
        addon.steps.segment(scene).wait()


def test_one_button_learns_everything_and_shows_the_picture(bpy, addon, project_scene, tmp_path):
    addon.images.write_png(tmp_path / "masks" / "pot" / "photo_0.png", np.ones((16, 24, 3)))
    assert not bpy.ops.karf.learn_all.poll()
    project_scene.karf.masks = str(tmp_path / "masks")
    assert bpy.ops.karf.learn_all() == {"FINISHED"}
    assert addon.contents.finished_stages(project_scene) == {"geometry", "segmentation", "palette", "recoloring"}
    assert project_scene.karf.objects.keys() == ["lid", "pot"] and project_scene.karf.result is not None
