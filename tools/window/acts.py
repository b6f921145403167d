"""Actions of several steps: jobs, files, editors. Runs inside Blender."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import controls, hands
from .desk import check, module, until
from .hands import BESIDE_PICTURE, PICTURE, SIDEBAR, VIEW, Wait, Where
from .record import Story

TAB = "KaRF"
JOB_SECONDS = 1800.0  # a machine may be busy with other things


def choose_engine(job: dict) -> None:
    """Set the engine's Python in the preferences."""
    preferences = module("preferences").current()
    preferences.engine_python, preferences.threads = job["engine_python"], job["threads"]


# --- jobs ------------------------------------------------------------------------------------------------------------
def begin_job(press: Wait) -> Wait:
    """Press what starts a job, and wait until it has begun; a short one may have ended, and left its text."""
    progress = bpy.data.window_managers[0].karf_progress
    progress.text = progress.error = ""
    yield from press
    yield from until(lambda: progress.text or progress.error, "the job")
    yield from hands.move(hands.middle_of(PICTURE))  # a button under the mouse would stay greyed out after the job


def end_job(expected: str = "done") -> Wait:
    """Wait for the running job; Broken where it ends otherwise than expected."""
    progress = bpy.data.window_managers[0].karf_progress
    yield from until(lambda: not module("tasks.runner").is_running(), "the job's end", JOB_SECONDS)
    check(not progress.error, f"{progress.stage} failed: {progress.error}")
    check(progress.text == expected, f"{progress.stage} ended as {progress.text!r}, not {expected!r}")
    yield 0.5


def press_job(operator: str) -> Wait:
    """Click a button that starts a job, and wait for its end."""
    yield from begin_job(controls.press_button(SIDEBAR, operator))
    yield from end_job()


def dialog_job(story: Story, operator: str) -> Wait:
    """Click a button, confirm its dialog, and wait for the end of its job."""
    yield from controls.press_button(SIDEBAR, operator)
    yield 0.5
    yield from story.shoot("dialog")
    yield from begin_job(hands.press("RET", hands.middle_of(VIEW)))
    yield from end_job()


# --- files and editors -----------------------------------------------------------------------------------------------
def editors(kind: str) -> int:
    """Return the number of editors of a type in the window."""
    return sum(area.type == kind for area in hands.window().screen.areas)


def open_advanced() -> None:
    """Open the advanced controls of all steps by script."""
    advanced = module("preferences").current().advanced
    for name in advanced.bl_rna.properties.keys():
        if name.startswith("show_"):
            setattr(advanced, name, True)


def show_tab() -> Wait:
    """Bring the KaRF tab to the front in both sidebars."""
    for where in (SIDEBAR, BESIDE_PICTURE):
        sidebar = hands.region_of(where)
        sidebar.active_panel_category = TAB
        sidebar.tag_redraw()
    yield 0.5


def fit_picture() -> Wait:
    """Fit the picture into its editor."""
    with hands.inside(PICTURE):
        bpy.ops.image.view_all(fit_view=True)
    yield 0.5


def save_file() -> Wait:
    """Press Ctrl S."""
    yield from hands.press("S", hands.middle_of(VIEW), ctrl=True)
    yield from until(lambda: not bpy.data.is_dirty, "saving")


def choose_file(path: Path) -> Wait:
    """Choose a file or folder in the open file browser: set the path by script, click the button."""
    yield from until(lambda: editors("FILE_BROWSER"), "the file browser")
    yield 0.5
    params = hands.area_of("FILE_BROWSER").spaces.active.params
    folder, name = (path, "") if path.is_dir() else (path.parent, path.name)
    params.directory, params.filename = str(folder).encode(), name
    yield 0.5
    yield from controls.press_button(Where("FILE_BROWSER", "EXECUTE"), r"file\.execute", 0.93)
    yield from until(lambda: not editors("FILE_BROWSER"), "the file browser's end", 30)
    yield 0.5


def save_file_as(blend: Path) -> Wait:
    """Press Ctrl Shift S, and save to another place."""
    yield from hands.press("S", hands.middle_of(VIEW), ctrl=True, shift=True)
    yield from choose_file(blend)
    yield from until(lambda: bpy.data.filepath == str(blend), "saving")


def undo(**modifiers: bool) -> Wait:
    """Press Ctrl Z."""
    yield from hands.press("Z", hands.middle_of(VIEW), ctrl=True, **modifiers)
    yield 0.5
