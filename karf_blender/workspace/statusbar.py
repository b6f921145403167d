"""The running job in Blender's status bar, visible in every workspace."""

import bpy

from .. import session
from ..host.words import translate
from ..tasks import runner


def draw(self, context):
    state = context.window_manager.karf_progress
    if state.running:
        row = self.layout.row(align=True)
        row.label(text=f"KaRF: {translate(state.stage)}", icon="SORTTIME")
        draw_progress(row, state)
        row.label(text=state.figures)
    elif state.error:
        self.layout.label(text=f"KaRF: {state.error}", icon="ERROR")


def draw_progress(row, state):
    """Draw the bar of the running job and the cross that stops it."""
    row.progress(factor=state.fraction, text=state.text)
    row.operator("karf.cancel", text="", icon="CANCEL")


@session.listener(runner.STATUS_CHANGED)
def redraw() -> None:
    """Redraw the status bars. Python has no access to these areas, but setting their text redraws them."""
    for window in bpy.data.window_managers[0].windows:
        if not window.modal_operators:  # a running tool may have set its text, and redraws it
            window.workspace.status_text_set_internal(None)


def _header() -> type:
    """Return the status bar's header, without the replacement by a tool."""
    # `WorkSpace.status_text_set` restores what it saved before its first call: a later addition would be lost
    header = bpy.types.STATUSBAR_HT_header
    header.draw = getattr(header, "_draw_orig", header.draw)
    return header


@session.setup
def _in_status_bar():
    header = _header()
    header.append(draw)
    header._draw_orig = header.draw
    yield
    _header().remove(draw)
