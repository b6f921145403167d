"""The engine at a glance: whether there is one, and the buttons that install, repair, update and remove it."""

import bpy

from ..engine import installing
from ..engine.installer.home import BROKEN, NONE, OUTDATED, READY, UNFINISHED
from ..engine.installer.plan import size_text
from ..engine_api import Cancelled, Message
from ..host.labels import draw_text
from . import state
from .state import Engine
from .testing import WIDTH

OFFLINE = (
    "Blender may not use the network: switch on System > Network > Allow Online Access, or install from a folder of "
    "wheels."
)
MISSING = "There is no engine yet."
HOW = Message("There is no engine yet. Press Install Engine, or set Engine Python below to a Python that has PyTorch.")
# what the button that installs does by the state of what is there
VERBS = {NONE: "Install Engine", UNFINISHED: "Go On", BROKEN: "Repair", OUTDATED: "Update", READY: "Repair"}


def draw_engine(layout):
    """The state in a sentence, the installation at work, and the buttons."""
    engine = state.known()
    if installing.is_running():
        draw_progress(layout)
        return
    draw_text(layout, sentence(engine), "ERROR" if engine.problem else "CHECKMARK", WIDTH)
    used = state.disk_use()
    if engine.managed.state != NONE:
        size = f", {size_text(used)}" if used else ""
        draw_text(layout, f"{engine.folder}{size}", "BLANK1", WIDTH)
    error = installing.last_error()
    if error and not isinstance(error, Cancelled):  # who has cancelled knows it
        column = layout.column(align=True)
        column.alert = True
        draw_text(column, error.sentence, "CANCEL", WIDTH)
        draw_text(layout, error.hint, "BLANK1", WIDTH)
    if engine.problem and not bpy.app.online_access:
        draw_text(layout, OFFLINE, "INTERNET_OFFLINE", WIDTH)
    draw_buttons(layout.row(align=True), engine)


def sentence(engine: Engine) -> str:
    """Whether there is an engine, for people."""
    managed = engine.managed
    if engine.is_managed and managed.state == READY:
        return f"Engine ready. {managed.sentence}"
    if engine.is_managed:
        return managed.sentence
    if not engine.problem:
        return f"Engine Python: {engine.python}. Test Engine says whether it works."
    if managed.state != NONE:
        return managed.sentence
    return HOW if engine.problem.startswith(MISSING) else engine.problem


def draw_progress(layout):
    """The installation at work, and its end."""
    progress = installing.progress()
    if not installing.can_be_cancelled():
        layout.label(text=progress.title, icon="SORTTIME")
        return
    row = layout.row(align=True)
    row.progress(factor=progress.fraction, text=progress.title)
    row.operator("karf.cancel_installation", text="", icon="CANCEL")
    draw_text(layout, progress.sentence, "BLANK1", WIDTH)


def draw_buttons(row, engine: Engine):
    """Install, or continue from what is there, and remove."""
    managed = engine.managed
    install = row.operator("karf.install_engine", text=VERBS[managed.state], icon="IMPORT")
    install.build, install.photos = managed.build, "photos" in managed.extras
    if managed.state != NONE:
        row.operator("karf.remove_engine", icon="TRASH")
