"""Which engine the user has chosen, and its state as read last, for drawing; what watches the disk calls `refresh`."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import engine_api, session
from ..engine.installer import home
from ..engine.installer.home import NONE, Status
from ..engine_api import MissingDependency
from ..host import windows

VARIABLE = "KARF_ENGINE_PYTHON"
HAS_TIMER = not bpy.app.background  # without timers nothing watches the disk: `known` reads it
NOTHING = Status(NONE, "")
SLICE = 50  # folders measured at once
SLICE_SECONDS = 0.05


def current() -> bpy.types.AddonPreferences:
    return bpy.context.preferences.addons[extension].preferences


def engine_folder() -> Path:
    """Return where the installed engine is, or would be: outside the extension, which updates replace."""
    chosen = current().engine_folder
    return Path(chosen) if chosen else Path(bpy.utils.extension_path_user(extension, path="engine"))


def chosen_python() -> Path:
    """Return the engine's Python, there or not; raises MissingDependency where its path depends on the open file."""
    chosen = _set_by_user()
    if not chosen:
        checkout = engine_api.ENGINE_FOLDER.parent / ".venv" / "engine"
        return home.python_in(engine_folder()) or home.python_of(checkout)
    # two slashes mean the .blend's folder, and a stranger's .blend may bring a program
    if chosen.startswith("//") or not Path(chosen).is_absolute():
        raise MissingDependency(
            "The engine's Python {python} is not an absolute path.",
            "Set it in the KaRF preferences, in the file browser with Relative Path off.",
            python=chosen,
        )
    return Path(chosen)


def engine_python() -> Path:
    """Return the Python that runs the engine; raises MissingDependency where none is known, or it is gone."""
    python = chosen_python()
    if python.is_file():
        return python
    if _set_by_user():
        raise MissingDependency(
            "The engine's Python {python} does not exist.", "Set it in the KaRF preferences.", python=python
        )
    raise MissingDependency(
        "There is no engine yet.",
        "Press Install Engine in the KaRF preferences, or set Engine Python there to a Python that has PyTorch.",
    )


def has_engine() -> bool:
    try:
        return engine_python().is_file()
    except MissingDependency:
        return False


def _set_by_user() -> str:
    return current().engine_python or os.environ.get(VARIABLE, "")


@dataclass(frozen=True)
class Engine:
    python: Path | None = None  # the chosen one, there or not; None where its path is refused
    problem: str = ""  # why no engine can run, with the remedy
    folder: Path = Path()
    managed: Status = NOTHING  # what is in the folder

    @property
    def is_managed(self) -> bool:
        return self.managed.is_usable and self.python == home.python_of(self.folder / self.managed.environment)


@dataclass
class _State:
    engine: Engine = Engine()  # as read last
    used: int | None = None  # bytes that the managed environment takes
    measuring: Iterator[int] | None = None


def known() -> Engine:
    if not HAS_TIMER:
        refresh()
    return session.get(_State).engine


def disk_use() -> int | None:
    """Return the bytes that the managed environment takes; None while they are counted."""
    state = session.get(_State)
    return None if state.measuring else state.used


def refresh() -> bool:
    """Read the disk; True where something has changed. Never raises."""
    state = session.get(_State)
    before, state.engine = state.engine, _read()
    if before == state.engine:
        return False
    state.used = None
    if state.engine.managed.is_usable and HAS_TIMER:
        state.measuring = home.measure(state.engine.folder)
        session.start_timer(_tick, persistent=True)
    return True


def _read() -> Engine:
    folder = engine_folder()
    managed = home.status(folder)
    python, problem = None, ""
    try:
        python = chosen_python()
        engine_python()
    except MissingDependency as error:
        problem = error.message
    return Engine(python, problem, folder, managed)


def _tick() -> float | None:
    state = session.get(_State)
    counted = list(islice(state.measuring, SLICE))
    if counted:
        state.used = counted[-1]
        return SLICE_SECONDS
    state.measuring = None
    windows.redraw("PREFERENCES")
    return None
