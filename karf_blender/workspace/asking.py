"""At the first save of a file whose project lies in the extension's own folder: shall it move beside the file?"""

from dataclasses import dataclass, field

import bpy

from .. import session
from ..host import windows
from ..project import disk, moving

ASK_SECONDS = 0.1  # after a save, until Blender takes questions again


@dataclass
class _State:
    """The projects that were asked about in this session."""

    asked: set[str] = field(default_factory=set)


def window_to_ask() -> bpy.types.Window | None:
    """A window whose scene has a project that nobody was asked about yet, and nobody wants to leave where it is."""
    for window in bpy.data.window_managers[0].windows:
        karf = window.scene.karf
        if moving.is_hidden(window.scene) and not karf.stays_hidden and karf.project not in session.get(_State).asked:
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
            session.get(_State).asked.add(window.scene.karf.project)
            bpy.ops.karf.move_project("INVOKE_DEFAULT")


@session.handler("save_post")
def _after_save(*_):
    if not bpy.app.background and bpy.data.filepath and not bpy.app.timers.is_registered(_ask):
        session.start_timer(_ask, ASK_SECONDS)
