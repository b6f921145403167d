"""How smoothly the scene in the 3D View follows a dragged swatch. Runs inside Blender with a window; prints JSON.

    blender --python tools/speed/scene_in_3d.py -- CAPTURE PROJECT POINTS.npz [--seconds 10]

The 3D View fills the window and looks through the capture's first camera. Frames a second are of whole redraws: of the
same file without the object, with it while nothing changes, and with it while a swatch changes before every redraw; in
Solid mode (flat, attribute) and in Material Preview. POINTS.npz: `karf points PROJECT --out POINTS.npz`.
"""

import argparse
import importlib
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from blender_swatch import MODULE, enable

MODES = {"solid": "SOLID", "material preview": "MATERIAL"}


def main(options: argparse.Namespace) -> None:
    with tempfile.TemporaryDirectory() as folder:
        enable(Path(folder) / "repository")
        steps = importlib.import_module(f"{MODULE}.karf_blender.steps")
        for each in list(bpy.data.objects):  # the cube, in the scene's middle
            bpy.data.objects.remove(each)
        scene = bpy.context.scene
        steps.import_capture(scene, options.capture, options.project, rig=steps.RigOptions(photos=False))
        area = largest_view()
        space = area.spaces.active
        space.overlay.show_overlays = space.show_region_ui = space.show_region_toolbar = False
        scene.view_settings.view_transform = "Standard"
        steps.look_through(scene, scene.karf.active_view)
        space.region_3d.view_perspective = "CAMERA"
        begin = time.perf_counter()
        item = steps.place_points(scene, options.points)
        made = time.perf_counter() - begin
        rows = {name: measured(scene, space, item, shading, options) for name, shading in MODES.items()}
    figures = {"points": len(item.data.polygons), "made_s": round(made, 2), "frames_a_second": rows}
    figures |= {"view": [area.width, area.height], "blender": bpy.app.version_string}
    print(json.dumps(figures), flush=True)


def largest_view() -> bpy.types.Area:
    """The 3D View of the window, as large as the window."""
    window = bpy.context.window_manager.windows[0]
    area = max((each for each in window.screen.areas if each.type == "VIEW_3D"), key=lambda each: each.width)
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    return next(each for each in window.screen.areas if each.type == "VIEW_3D")


def measured(scene, space, item, shading: str, options) -> dict[str, float]:
    """Frames a second in one mode."""
    swatch = scene.karf.objects[0].swatches[1]
    space.shading.type = shading
    if shading == "SOLID":
        space.shading.light, space.shading.color_type = "FLAT", "VERTEX"
    rows = {}
    for name, is_shown, is_dragged in (("without", False, False), ("still", True, False), ("dragged", True, True)):
        item.hide_set(not is_shown)
        redraw()
        begin, count = time.perf_counter(), 0
        while time.perf_counter() - begin < options.seconds or count < 3:
            if is_dragged:
                swatch.color = ((count % 20) / 20, 0.3, 0.8)
            redraw()
            count += 1
        rows[name] = round(count / (time.perf_counter() - begin), 2)
    return rows


def redraw() -> None:
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture")
    parser.add_argument("project")
    parser.add_argument("points")
    parser.add_argument("--seconds", type=float, default=10, help="of each figure (default: %(default)s)")
    return parser.parse_args(arguments)


def run() -> None:
    """Called when the window is there; ends Blender."""
    code = 1
    try:
        main(parse(sys.argv[sys.argv.index("--") + 1 :]))
        code = 0
    finally:
        os._exit(code)


if __name__ == "__main__":
    bpy.app.timers.register(run, first_interval=2)
