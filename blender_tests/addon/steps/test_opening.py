"""Open Folder: the folders in which files appear."""

import subprocess
import sys

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="other systems open folders otherwise")
def test_the_folders_in_which_files_appear_are_opened(bpy, addon, learned, tmp_path, monkeypatch):
    opened = []
    # what Blender's own operator calls
    monkeypatch.setattr(subprocess, "check_call", lambda command: opened.append(command[-1]))
    with pytest.raises(RuntimeError, match="does not exist yet"):
        bpy.ops.karf.open_folder(folder="out")
    bpy.ops.karf.open_folder(folder="project")
    frames = addon.steps.render_captured(learned, "all", tmp_path / "elsewhere").wait()
    bpy.ops.karf.open_folder(folder="frames")
    bpy.ops.karf.open_folder(folder="written")
    assert opened == [str(addon.folders.project_of(learned).folder), str(frames), str(frames)]
    bpy.ops.karf.export_cameras(filepath=str(tmp_path / "film" / "cameras.json"))
    bpy.ops.karf.open_folder(folder="written")
    assert opened[-1] == str(tmp_path / "film")
