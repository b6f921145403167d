"""Writes this version's file that later versions must open, with what it shows (see saved_files.py):

    KARF_ENGINE_PYTHON=.venv/engine/bin/python PYTHON -m pytest blender_tests/addon/data/make_saved_file.py

PYTHON has the oldest supported Blender, so that all others can open the file.
"""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np

from ..rich_project import enrich
from ..saved_files import DATA, TRIALS, everything_stored, run_trial

ROOT = Path(__file__).resolve().parents[3]


def test_make(bpy, addon, learned, capture_folder, tmp_path):
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["version"]
    enrich(bpy, tmp_path / "project")
    _edit(bpy)
    blend = tmp_path / "scene.blend"
    for _ in range(2):  # paths are relative to where it was saved
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), compress=True)
        bpy.ops.file.make_paths_relative()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    expected = {"blender": bpy.app.version_string, "stored": everything_stored(bpy.context.scene.karf), "trials": {}}
    pictures = {}
    for trial in TRIALS:
        expected["trials"][trial], pictures[trial.replace(" ", "_")] = run_trial(bpy, blend, trial, tmp_path)
    (tmp_path / "shown.json").unlink()
    shutil.rmtree(tmp_path / "project" / "jobs", ignore_errors=True)
    target = DATA / f"saved_by_{version}"
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir()
    for name in ("scene.blend", "project", "pots"):
        shutil.move(tmp_path / name, target / name)
    (target / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")
    np.savez_compressed(target / "pictures.npz", **pictures)


def _edit(bpy):
    """Make one edit of every kind."""
    scene, ops = bpy.context.scene, bpy.ops.karf
    karf, lid, pot = scene.karf, scene.karf.objects["lid"], scene.karf.objects["pot"]
    # two looks, and an unsaved one in use
    pot.swatches[1].color = (0.7, 0.4, 0.1)
    ops.keep_look(name="Day")
    karf.compositing = "paper"
    lid.swatches[1].color = (0.1, 0.2, 0.3)
    ops.keep_look(name="Night")
    ops.choose_look(name="Day")
    karf.compositing = "paper"
    ops.reset_swatch(object_name="pot")
    # one paint after the other: the first is held
    pot.show_becomes = True
    pot.source, pot.target = (0.8, 0.15, 0.1), (0.85, 0.5, 0.1)
    ops.becomes(object_name="pot")
    pot.source, pot.target = (0.15, 0.55, 0.2), (0.2, 0.3, 0.6)
    ops.becomes(object_name="pot")
    assert pot.held
    # linked, merged and locked swatches, surfaces, an added color, an edge
    ops.link_swatches(object_name="pot", index=4, other_name="lid", other_index=3)
    ops.merge_swatch(object_name="pot", index=2, into=1)
    lid.swatches[2].locked = True
    pot.show_surface = pot.show_edge = lid.is_metal = True
    green = pot.swatches[3]
    green.saturation, green.brightness, green.gloss = 0.6, 0.3, 0.5
    ops.add_color(object_name="lid", picked=lid.swatches[1].learned, reach=0.8, protect=0.1)
    next(swatch for swatch in lid.swatches if swatch.is_added).color = (0.3, 0.5, 0.4)
    pot.choke, pot.feather = 0.5, 1.5
    # animated
    for frame, color, gloss in ((1, (0.2, 0.4, 0.7), 0.5), (11, (0.5, 0.2, 0.6), 1.5)):
        lid.swatches[1].color, green.gloss = color, gloss
        lid.swatches[1].keyframe_insert("color", frame=frame)
        green.keyframe_insert("gloss", frame=frame)
    # other settings
    karf.captured_size, karf.captured_pixels, karf.preset = "PIXELS", 333, "fine"
    karf.file_format, karf.color_mode, karf.color_depth = "OPEN_EXR", "RGBA", "32"
    karf.skip_existing = karf.fade_unseen = False
    karf.photo_space, karf.layer_space, karf.card = "ACEScg", "lin_rec709", (0.48, 0.47, 0.45)
    karf.holdout, karf.marking.brush, karf.surface.count = 7, 41, 20_000
    karf.match.show = True
    one = karf.marking.objects.add()
    one.name = "pot"
    scene.frame_set(4)
