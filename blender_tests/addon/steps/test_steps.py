"""The scripting interface: steps take a scene, docs call them correctly, and tasks return results."""

import ast
import importlib
import inspect
import re

import numpy as np
import pytest

from ..conftest import MODULE, ROOT

BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
PAGES = [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) if "bl_ext" in path.read_text()]


def public(steps):
    """The step functions, without those that manage the engine's environment and take no scene."""
    found = {name: each for name, each in vars(steps).items() if inspect.isfunction(each)}
    return {name: each for name, each in found.items() if not each.__module__.endswith(".engine")}


def test_every_step_takes_the_scene_first(addon):
    steps = public(addon.steps)
    assert len(steps) > 60
    assert [name for name, step in steps.items() if next(iter(inspect.signature(step).parameters)) != "scene"] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_doc_scripts_call_steps_with_valid_arguments(addon, page):
    blocks = [block for block in BLOCK.findall(page.read_text()) if "karf_blender import steps as karf" in block]
    calls = [node for block in blocks for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Call)]
    calls = [call for call in calls if ast.unparse(call.func).rpartition(".")[0] == "karf"]
    assert calls
    for call in calls:
        signature = inspect.signature(getattr(addon.steps, call.func.attr))
        signature.bind(*call.args, **{each.arg: each.value for each in call.keywords})
        if call.func.attr in public(addon.steps):
            assert ast.unparse(call.args[0]) == "scene"


def test_old_module_name_raises_with_the_new_name(addon):
    package = importlib.import_module(f"{MODULE}.karf_blender")
    with pytest.raises(ImportError, match="headless is now steps"):
        exec(f"from {package.__name__} import headless")
    assert not hasattr(package, "handless")


def test_steps_use_the_given_scene_and_tasks_return_results(addon, learned):
    other = learned.copy()
    addon.steps.set_swatch(other, "pot", 1, "#00ff00")
    assert tuple(other.karf.objects["pot"].swatches[1].color) == (0, 1, 0)
    assert tuple(learned.karf.objects["pot"].swatches[1].color) != (0, 1, 0)
    path = addon.steps.render_view(learned).wait()
    assert path.is_file() and path.stem == learned.karf.active_view and path.parent.name == "Recolored"
    task = addon.steps.show_view(learned)  # already prepared
    assert task.requests == () and task.wait() == learned.karf.result


def test_pretrained_nerf_is_passed_to_learning(addon, project_scene, tmp_path):
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] is None
    project_scene.karf.nerf = str(tmp_path / "200000.tar")
    assert addon.steps.learn_scene(project_scene).requests[0].options["nerf"] == str(tmp_path / "200000.tar")


def test_steps_out_of_order_are_rejected_with_reasons(bpy, addon, scene):
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
    assert addon.disk.read(project_scene).stages == {"geometry", "segmentation", "palette", "recoloring"}
    assert project_scene.karf.objects.keys() == ["lid", "pot"] and project_scene.karf.result is not None
