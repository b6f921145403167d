"""What steps ask of the engine, and what they refuse."""

import pytest


def test_a_pretrained_nerf_goes_along_with_what_is_learned(addon, project_scene, tmp_path):
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] is None
    project_scene.karf.nerf = str(tmp_path / "200000.tar")
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] == str(tmp_path / "200000.tar")


def test_steps_out_of_order_are_refused_in_words(bpy, addon, scene):
    assert not bpy.ops.karf.learn_scene.poll()
    with pytest.raises(addon.engine_api.BadRequest, match="no capture"):
        addon.headless.learn_scene()
    with pytest.raises(addon.engine_api.BadRequest, match="No masks"):
        addon.headless.segment()
