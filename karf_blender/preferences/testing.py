"""What the test of the engine has found, line by line, with what to do about it."""

from ..engine import probing
from ..engine_api import ERROR, OK, WARNING, Finding
from ..host.labels import draw_text
from . import state

ICONS = {OK: "CHECKMARK", WARNING: "ERROR", ERROR: "CANCEL"}  # Blender's icon ERROR is the triangle of warnings
WIDTH = 96  # letters that fit the preferences' usual width


def draw_test(layout):
    """The buttons of the test, and its findings so far."""
    row = layout.row(align=True)
    is_running = probing.is_running()
    row.operator("karf.examine_engine", text="Testing ..." if is_running else "Test Engine", icon="CHECKMARK")
    if is_running:
        row.operator("karf.cancel_examination", text="", icon="CANCEL")
    row.operator("karf.copy_findings", icon="COPYDOWN")
    python = state.known().python
    verdict = probing.verdict_on(python)
    column = layout.column(align=True)
    if verdict is not None:  # first: below a long list nobody would see it
        draw_finding(column.box(), verdict)
    for finding in probing.findings_on(python):
        if finding is not verdict:
            draw_finding(column, finding)


def draw_finding(layout, finding: Finding):
    """One finding; its remedy only where something is amiss."""
    draw_text(layout, finding.sentence, ICONS[finding.status], WIDTH)
    if finding.status == OK:
        return
    draw_text(layout, finding.remedy, "BLANK1", WIDTH)
    if finding.command:
        draw_command(layout, finding.command)


def draw_command(layout, command: str):
    """A command for a terminal, with the button that copies it."""
    row = layout.row(align=True)
    draw_text(row, command, "BLANK1", WIDTH)
    row.operator("karf.copy_command", text="", icon="COPYDOWN").command = command
