"""The running job in Blender's status bar, which every workspace shows."""

import bpy

from .. import session
from ..host.words import translate
from ..tasks import runner


def draw(self, context):
    """Added at the end of the status bar: the job with its cross, else nothing but how the last one failed."""
    state = context.window_manager.karf_progress
    if state.running:
        row = self.layout.row(align=True)
        row.label(text=f"KaRF: {translate(state.stage)}", icon="SORTTIME")
        draw_progress(row, state)
        row.label(text=state.figures)
    elif state.error:
        self.layout.label(text=f"KaRF: {state.error}", icon="ERROR")


def draw_progress(row, state):
    """The bar of the running job, and the cross that stops it."""
    row.progress(factor=state.fraction, text=state.text)
    row.operator("karf.cancel", text="", icon="CANCEL")


@session.listener(runner.STATUS_CHANGED)
def redraw() -> None:
    """Draw the status bars again. They are not areas that Python knows: setting their text is what redraws them.

    While a tool has its own text there, that is left alone; its next change draws the bar.
    """
    for window in bpy.data.window_managers[0].windows:
        if not window.modal_operators:
            window.workspace.status_text_set_internal(None)


def _header() -> type:
    """The status bar's header as Blender draws it while no tool has taken its place.

    `WorkSpace.status_text_set` keeps how it was drawn before its first call, and puts that back after each. The operator
    that installs extensions calls it: what an extension then appends would be gone.
    """
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
