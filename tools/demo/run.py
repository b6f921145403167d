"""The main job through real Blender: import the demo capture, learn it, recolor it twice, render, save.

Run by `tools/dev.py demo` in the Blender environment; the engine runs in child processes, as at a user's desk.
Whatever is already done in OUT is not done again.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import traceback
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

from ..metrics.truth import DEMO, Truth

ROOT = Path(__file__).resolve().parents[2]

TRUTH = Truth()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int, default=0)
    options = parser.parse_args()
    out = options.out.absolute()
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="karf-demo-") as repository:
        karf = enable_extension(Path(repository), options.threads)
        seconds = main_job(karf, out)
    facts = {"seconds": seconds, "seconds_main_job": round(time.monotonic() - start, 1)}
    (out / "main_job.json").write_text(json.dumps(facts, indent=1))


def main_job(karf, out: Path) -> dict[str, float]:
    """From the capture to recolored frames and a saved .blend; returns seconds by step."""
    seconds: dict[str, float] = {}
    scene = bpy.context.scene
    capture = timed(seconds, "import", lambda: karf.import_capture(scene, DEMO, out / "project"))
    timed(seconds, "geometry", karf.learn_scene(scene, "demo").wait)
    timed(seconds, "segmentation", karf.segment(scene, DEMO / "coarse_masks" / "one").wait)
    timed(seconds, "palette", karf.extract_palette(scene).wait)
    for name, edit in TRUTH.edits.items():
        recolor(karf, name, edit, out, seconds)
    timed(seconds, "splats", karf.learn_splats(scene).wait)
    view = next(v for v in capture.views if v.split == "test")
    karf.show_view(scene, view.name).wait()
    bpy.ops.wm.save_as_mainfile(filepath=str(out / "demo.blend"))
    return seconds


def enable_extension(repository: Path, threads: int):
    """Load this checkout as the extension that a user would install there; returns its steps."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    (repository / "karf").symlink_to(ROOT, target_is_directory=True)
    repositories = bpy.context.preferences.extensions.repos
    repositories.new(name="KaRF demo", module="karf_demo", custom_directory=str(repository))
    module = "bl_ext.karf_demo.karf"
    bpy.ops.preferences.addon_enable(module=module)
    if threads:
        bpy.context.preferences.addons[module].preferences.threads = threads
    return import_module(f"{module}.karf_blender.steps")


def timed(seconds: dict[str, float], name: str, function):
    """Call, print and note how long it took."""
    print(f"== {name}", flush=True)
    begin = time.monotonic()
    result = function()
    seconds[name] = round(time.monotonic() - begin, 2)
    return result


def recolor(karf, name: str, edit: dict, out: Path, seconds: dict[str, float]) -> None:
    """One edit: for each object, what the eyedropper reads before and after in the one known view; then all test frames."""
    scene = bpy.context.scene
    karf.apply_edit(scene, learned_edit(karf))
    for object_name in edit["objects"]:
        source, target = TRUTH.color_pair(name, object_name)
        print(f"   {object_name}: {hexadecimal(source)} becomes {hexadecimal(target)}", flush=True)
        karf.becomes(scene, object_name, source, target)
    karf.save_edit(scene, out / "edits" / f"{name}.json")
    karf.keep_look(scene, name)
    timed(seconds, f"render {name}", karf.render_captured(scene, "test", out / "frames").wait)


def learned_edit(karf):
    """The edit that changes nothing."""
    package = karf.__name__.rpartition(".")[0]
    palettes = import_module(f"{package}.swatches.colors").palettes(bpy.context.scene)
    return karf.Edit({palette.name: palette.colors for palette in palettes})


def hexadecimal(color: np.ndarray) -> str:
    return "#" + "".join(f"{round(c * 255):02x}" for c in color)


if __name__ == "__main__":
    code = 0
    try:
        main()
    except Exception as error:  # the environment's Blender may crash at exit, which would hide the reason
        traceback.print_exc()
        print(f"error: {error}", file=sys.stderr)
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
