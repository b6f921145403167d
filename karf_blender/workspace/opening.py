"""The KaRF workspace: 3D View, Image Editor and timeline, both sidebars at the KaRF tab.

It comes from a file that `tools/window/make_workspace.py` has made.
"""

from pathlib import Path

import bpy

from ..host import windows

FILE = Path(__file__).with_name("workspace.blend")
NAME = TAB = "KaRF"
LATER, TRIES = 0.2, 20  # a sidebar knows its tabs when it was drawn: seconds to the next look, and how often
ASIDE = "UI"


class _Memory:
    """How often it is still looked whether the sidebars are drawn."""

    tries: int = 0


def open_workspace(window: bpy.types.Window) -> None:
    """Show the workspace in a window; it is added to the file where there is none of its name."""
    known = bpy.data.workspaces.get(NAME)
    if known is None:
        bpy.ops.workspace.append_activate(idname=NAME, filepath=str(FILE))
    else:
        window.workspace = known
    _Memory.tries = TRIES
    if not bpy.app.background and not bpy.app.timers.is_registered(_show_tabs):
        bpy.app.timers.register(_show_tabs, first_interval=LATER)


def _show_tabs() -> float | None:
    """Bring the tab to the front once both sidebars are drawn."""
    _Memory.tries -= 1
    sidebars = [
        region for area in windows.areas(*windows.PANEL_AREAS) for region in area.regions if region.type == ASIDE
    ]
    try:
        for region in sidebars:
            region.active_panel_category = TAB
            region.tag_redraw()
    except (AttributeError, TypeError):  # it has no tabs yet
        return LATER if _Memory.tries else None
    return None


def register():
    """Called when the extension is enabled."""


def unregister():
    """Called when the extension is disabled."""
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_show_tabs):
        bpy.app.timers.unregister(_show_tabs)
