"""Saving elsewhere: paths lead to the same places, and swatches stay the file's own."""

import json
import shutil

import pytest


@pytest.fixture
def saved(bpy, addon, learned, tmp_path):
    """The learned scene, edited, saved as root/first/shot.blend with its project beside it."""
    first = tmp_path / "root" / "first"
    shutil.copytree(addon.folders.project_of(learned).folder, first / "project")
    learned.karf.project = str(first / "project")
    addon.steps.set_swatch(learned, "pot", 1, (0.25, 0.5, 0.75))
    bpy.ops.wm.save_as_mainfile(filepath=str(first / "shot.blend"))
    assert learned.karf.project == "//project"
    return learned


def colors(scene):
    return {item.name: [tuple(swatch.color) for swatch in item.swatches] for item in scene.karf.objects}


@pytest.mark.parametrize("as_copy", [False, True])
def test_saving_elsewhere_never_brings_another_projects_swatches(bpy, addon, saved, tmp_path, as_copy):
    project, before = addon.folders.project_of(saved).folder, colors(saved)
    # what the way from root/deep/er/ to the project names when it is followed from root/first/
    decoy = tmp_path / "first" / "project"
    decoy.mkdir(parents=True)
    content = {"schema": "karf-palette/1", "objects": [{"name": "decoy", "colors": [[0, 0, 0], [1, 0, 0]]}]}
    (decoy / "palette.json").write_text(json.dumps(content))
    (tmp_path / "root" / "deep" / "er").mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "root" / "deep" / "er" / "shot.blend"), copy=as_copy)
    assert colors(saved) == before
    assert addon.folders.project_of(saved).folder == project


def test_a_save_that_fails_leaves_the_paths_as_they_were(bpy, addon, saved, tmp_path):
    before = colors(saved)
    with pytest.raises(RuntimeError, match="Cannot open file"):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "no such folder" / "shot.blend"))
    assert saved.karf.project == "//project"
    assert colors(saved) == before
