"""Make the workspace that the extension brings: `blender --factory-startup --python make_workspace.py -- FILE`.

It needs a window, since Blender divides no screen without one. Use the oldest Blender that is at hand: newer ones read
what it writes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # Blender runs this file by its path
from tools.window import hands
from tools.window.hands import VIEW, Wait

TIMELINE, PICTURE = 0.12, 0.5  # shares of the window: the timeline's height, the Image Editor's width


def build(file: str) -> Wait:
    """Divide the window's screen, show the sidebars, and save a file of nothing else."""
    screen = hands.window().screen
    while len(screen.areas) > 1:
        small = min(screen.areas, key=lambda area: area.width * area.height)
        region = next(each for each in small.regions if each.type == "WINDOW")
        with bpy.context.temp_override(window=hands.window(), screen=screen, area=small, region=region):
            bpy.ops.screen.area_close()
        yield 0.3
    screen.areas[0].type = "VIEW_3D"
    yield 0.3
    yield from split("HORIZONTAL", TIMELINE)
    min(screen.areas, key=lambda area: area.height).ui_type = "TIMELINE"
    yield from split("VERTICAL", 1 - PICTURE)
    views = [area for area in screen.areas if area.type == "VIEW_3D"]
    max(views, key=lambda area: area.x).ui_type = "IMAGE_EDITOR"
    yield 0.5
    for editor in ("VIEW_3D", "IMAGE_EDITOR"):
        hands.area_of(editor).spaces.active.show_region_ui = True
    hands.window().workspace.name = "KaRF"
    yield 0.5
    bpy.data.batch_remove([each for each in bpy.data.workspaces if each != hands.window().workspace])
    yield 0.5
    bpy.ops.wm.save_as_mainfile(filepath=file, compress=True, copy=True)


def split(direction: str, factor: float) -> Wait:
    with hands.inside(VIEW):
        bpy.ops.screen.area_split(direction=direction, factor=factor)
    yield 0.5


hands.play(build(sys.argv[-1]))
