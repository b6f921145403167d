"""At the first save of a file whose project lies in the extension's own folder: shall it move beside the file?"""

import bpy
from bpy.app.handlers import persistent

from ..host import handlers, windows
from ..project import disk, moving

ASK_SECONDS = 0.1  # after a save, until Blender takes questions again


class _Memory:
    """The projects that were asked about in this session."""

    asked: set[str] = set()


def window_to_ask() -> bpy.types.Window | None:
    """A window whose scene has a project that nobody was asked about yet, and nobody wants to leave where it is."""
    for window in bpy.data.window_managers[0].windows:
        karf = window.scene.karf
        if moving.is_hidden(window.scene) and not karf.stays_hidden and karf.project not in _Memory.asked:
            return window
    return None


def _ask() -> None:
    """The timer: asks by the operator that moves it, unless a job is at work; the next save asks then."""
    disk.refresh()
    window = window_to_ask()
    if window is None:
        return
    area = next(area for area in window.screen.areas if area.type in windows.PANEL_AREAS)
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        if bpy.ops.karf.move_project.poll():
            _Memory.asked.add(window.scene.karf.project)
            bpy.ops.karf.move_project("INVOKE_DEFAULT")


@persistent
def _after_save(*_):
    if not bpy.app.background and bpy.data.filepath and not bpy.app.timers.is_registered(_ask):
        bpy.app.timers.register(_ask, first_interval=ASK_SECONDS)


HANDLERS = (("save_post", _after_save),)


def register():
    """Called when the extension is enabled."""
    handlers.add(HANDLERS)


def unregister():
    """Called when the extension is disabled."""
    handlers.remove(HANDLERS)
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_ask):
        bpy.app.timers.unregister(_ask)
    _Memory.asked.clear()
