"""The user's settings of this machine: which Python runs the engine, how many threads, and how it is installed."""

import bpy
from bpy.props import BoolProperty, IntProperty, PointerProperty, StringProperty

from ... import __package__ as extension
from ..engine import installing, probing
from ..engine.installer.home import BROKEN, NONE, OUTDATED, READY, UNFINISHED
from ..engine.installer.plan import size_text
from ..engine_api import ERROR, OK, WARNING, Cancelled, Finding, Message, Options, bounds_of
from ..host.words import draw_text
from . import color_book, state
from .state import Engine, chosen_python, current, engine_folder, engine_python, has_engine

__all__ = ["chosen_python", "color_book", "current", "engine_folder", "engine_python", "has_engine", "state"]

OFFLINE = (
    "Blender may not use the network: switch on System > Network > Allow Online Access, or install from a folder of "
    "wheels."
)
MISSING = "There is no engine yet."
HOW = Message("There is no engine yet. Press Install Engine, or set Engine Python below to a Python that has PyTorch.")
# the label of the button that installs, by the state of the environment
VERBS = {NONE: "Install Engine", UNFINISHED: "Go On", BROKEN: "Repair", OUTDATED: "Update", READY: "Repair"}
ICONS = {OK: "CHECKMARK", WARNING: "ERROR", ERROR: "CANCEL"}  # Blender's icon ERROR is the triangle of warnings
WIDTH = 96  # letters that fit the preferences' usual width


def _make_paths_absolute(preferences, _):
    # a setting of this machine must not depend on the open file
    for name in ("engine_folder", "color_book"):
        if getattr(preferences, name).startswith("//"):
            setattr(preferences, name, bpy.path.abspath(getattr(preferences, name)))
    color_book.refresh()


def _fold_changed(preferences, context):
    context.preferences.is_dirty = True  # a fold alone would not be saved


class KARF_PG_advanced(bpy.types.PropertyGroup):
    """The steps whose advanced controls are open, in every file."""

    __annotations__ = {
        f"show_{step}": BoolProperty(name="Advanced", update=_fold_changed)
        for step in ("import", "mark", "learn", "edit", "render")
    }


class KARF_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = extension

    # a setting of this machine: unlike the scene's paths never relative to a .blend
    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        description="Absolute path of a Python with PyTorch, used instead of the installed engine. Empty: the "
        "variable KARF_ENGINE_PYTHON, or the installed engine",
    )
    engine_folder: StringProperty(
        name="Engine Folder",
        subtype="DIR_PATH",
        description="Folder for Install Engine. Empty: Blender's folder for this extension's files",
        update=_make_paths_absolute,
    )
    threads: IntProperty(
        name="Threads",
        min=0,
        max=bounds_of(Options, "threads")["max"],
        description="Number of engine threads, no more than free cores. 0: automatic",
    )
    marking_model: StringProperty(
        name="Marking Model",
        subtype="DIR_PATH",
        description="Absolute path of a folder with a Segment Anything model for boxes and clicks. Empty: boxes and "
        "clicks work without a model",
    )
    color_book: StringProperty(
        name="Color Book",
        subtype="FILE_PATH",
        description="Absolute path of a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. A "
        "swatch's menu shows the nearest names",
        update=_make_paths_absolute,
    )

    advanced: PointerProperty(type=KARF_PG_advanced)

    def draw(self, context):
        layout = self.layout
        _draw_engine(layout.box())
        for name in ("engine_python", "threads", "marking_model", "color_book"):
            layout.prop(self, name)
        if color_book.known().problem:
            draw_text(layout, color_book.known().problem, "ERROR", WIDTH)
        _draw_test(layout)


def _draw_engine(layout):
    engine = state.known()
    managed = engine.managed
    if installing.is_running():
        _draw_progress(layout)
        return
    draw_text(layout, sentence(engine), "ERROR" if engine.problem else "CHECKMARK", WIDTH)
    used = state.disk_use()
    if managed.state != NONE:
        size = f", {size_text(used)}" if used else ""
        draw_text(layout, f"{engine.folder}{size}", "BLANK1", WIDTH)
    error = installing.last_error()
    if error and managed.state != READY and not isinstance(error, Cancelled):  # who has cancelled knows it
        column = layout.column(align=True)
        column.alert = True
        draw_text(column, error.sentence, "CANCEL", WIDTH)
        draw_text(layout, error.hint, "BLANK1", WIDTH)
    if engine.problem and not bpy.app.online_access:
        draw_text(layout, OFFLINE, "INTERNET_OFFLINE", WIDTH)
    row = layout.row(align=True)
    install = row.operator("karf.install_engine", text=VERBS[managed.state], icon="IMPORT")
    install.build, install.photos = managed.build, "photos" in managed.extras
    if managed.state != NONE:
        row.operator("karf.remove_engine", icon="TRASH")


def sentence(engine: Engine) -> str:
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


def _draw_progress(layout):
    progress = installing.progress()
    if not installing.can_be_cancelled():
        layout.label(text=progress.title, icon="SORTTIME")
        return
    row = layout.row(align=True)
    row.progress(factor=progress.fraction, text=progress.title)
    row.operator("karf.cancel_installation", text="", icon="CANCEL")
    draw_text(layout, progress.sentence, "BLANK1", WIDTH)


def _draw_test(layout):
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
        _draw_finding(column.box(), verdict)
    for finding in probing.findings_on(python):
        if finding is not verdict:
            _draw_finding(column, finding)


def _draw_finding(layout, finding: Finding):
    draw_text(layout, finding.sentence, ICONS[finding.status], WIDTH)
    if finding.status == OK:
        return
    draw_text(layout, finding.remedy, "BLANK1", WIDTH)
    if finding.command:
        row = layout.row(align=True)
        draw_text(row, finding.command, "BLANK1", WIDTH)
        row.operator("karf.copy_command", text="", icon="COPYDOWN").command = finding.command
