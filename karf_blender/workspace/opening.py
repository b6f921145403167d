"""The KaRF workspace: 3D View, Image Editor and timeline, both sidebars at the KaRF tab."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import session
from ..host import windows

FILE = Path(__file__).with_name("workspace.blend")  # made by tools/window/make_workspace.py
NAME = TAB = "KaRF"
LATER, TRIES = 0.2, 20  # seconds between tries, and their number: a sidebar has no tabs before it is drawn


@dataclass
class SetUp:
    tries: int = 0  # that remain until the sidebars are drawn
    then: tuple[Callable[[bpy.types.Window], None], ...] = ()


def open_workspace(window: bpy.types.Window) -> None:
    """Show the workspace in a window; append it to the file if needed."""
    known = bpy.data.workspaces.get(NAME)
    if known is None:
        bpy.ops.workspace.append_activate(idname=NAME, filepath=str(FILE))
    else:
        window.workspace = known


def set_up(*then: Callable[[bpy.types.Window], None]) -> None:
    """Bring the tab to the front in windows that show the workspace, then call functions with each, redrawn between."""
    state = session.get(SetUp)
    state.tries, state.then = TRIES, then
    if not bpy.app.background:
        session.start_timer(_show_tabs, LATER)


def _show_tabs() -> float | None:
    state = session.get(SetUp)
    state.tries -= 1
    displayed = [window for window in bpy.data.window_managers[0].windows if window.workspace.name == NAME]
    areas = [area for window in displayed for area in window.screen.areas if area.type in windows.PANEL_AREAS]
    sidebars = [region for area in areas for region in area.regions if region.type == "UI"]
    try:
        for region in sidebars:
            region.active_panel_category = TAB
            region.tag_redraw()
    except (AttributeError, TypeError):  # it has no tabs yet
        sidebars = []
    if not sidebars:  # the window is not there yet
        return LATER if state.tries else None
    if state.then:
        for window in displayed:
            state.then[0](window)
        state.then = state.then[1:]
    return LATER if state.then else None
