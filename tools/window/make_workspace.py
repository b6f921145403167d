"""Make the workspace that the extension brings: `blender --factory-startup --python make_workspace.py -- FILE`.

It needs a window, since Blender divides no screen without one. Use the oldest Blender that is at hand: newer ones read
what it writes.
"""

from __future__ import annotations

import sys
from collections.abc import Generator

import bpy

NAME, TAB = "KaRF", "KaRF"
TIMELINE, PICTURE = 0.12, 0.5  # shares of the window: the timeline's height, the Image Editor's width
SIDEBARS = ("VIEW_3D", "IMAGE_EDITOR")


def window() -> bpy.types.Window:
    return bpy.data.window_managers[0].windows[0]


def inside(area: bpy.types.Area):
    region = next(each for each in area.regions if each.type == "WINDOW")
    return bpy.context.temp_override(window=window(), screen=window().screen, area=area, region=region)


def area_of(kind: str) -> bpy.types.Area:
    return next(area for area in window().screen.areas if area.type == kind)


def build(file: str) -> Generator[float, None, None]:
    """Divide the window's screen, show the sidebars, and save a file of nothing else."""
    yield 1.0
    while len(window().screen.areas) > 1:
        small = min(window().screen.areas, key=lambda area: area.width * area.height)
        with inside(small):
            bpy.ops.screen.area_close()
        yield 0.3
    window().screen.areas[0].type = "VIEW_3D"
    yield 0.3
    yield from split("HORIZONTAL", TIMELINE)
    low = min(window().screen.areas, key=lambda area: area.height)
    low.ui_type = "TIMELINE"
    yield from split("VERTICAL", 1 - PICTURE)
    right = max((area for area in window().screen.areas if area.type == "VIEW_3D"), key=lambda area: area.x)
    right.ui_type = "IMAGE_EDITOR"
    yield 0.5
    for kind in SIDEBARS:
        area_of(kind).spaces.active.show_region_ui = True
    window().workspace.name = NAME
    yield 0.5
    bpy.data.batch_remove([each for each in bpy.data.workspaces if each != window().workspace])
    yield 0.5
    bpy.ops.wm.save_as_mainfile(filepath=file, compress=True, copy=True)


def split(direction: str, factor: float) -> Generator[float, None, None]:
    with inside(area_of("VIEW_3D")):
        bpy.ops.screen.area_split(direction=direction, factor=factor)
    yield 0.5


def main() -> None:
    scenes = build(sys.argv[sys.argv.index("--") + 1])

    def tick() -> float | None:
        try:
            return next(scenes)
        except StopIteration:
            bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick)


main()
