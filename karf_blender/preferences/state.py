"""The state of the engine as last read from disk, for drawing.

The code that watches the disk calls `refresh`. In background mode nothing is drawn and timers never fire: there
`known` reads the disk.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import bpy

from .. import session
from ..engine.installer import home
from ..engine.installer.home import NONE, Status
from ..engine_api import MissingDependency
from ..host import windows
from . import choices

HAS_TIMER = not bpy.app.background
NOTHING = Status(NONE, "")
SLICE = 50  # folders measured at once
SLICE_SECONDS = 0.05


@dataclass(frozen=True)
class Engine:
    """The engine's Python, and the environment that the extension keeps."""

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
    """Return what there was of the engine when the disk was read last."""
    if not HAS_TIMER:
        refresh()
    return session.get(_State).engine


def disk_use() -> int | None:
    """Return the bytes that the managed environment takes; None while that is not known."""
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
    folder = choices.engine_folder()
    managed = home.status(folder)
    python, problem = None, ""
    try:
        python = choices.chosen_python()
        choices.engine_python()
    except MissingDependency as error:
        problem = error.message
    return Engine(python, problem, folder, managed)


def _tick() -> float | None:
    """The timer: measures some folders of the environment, which has thousands."""
    state = session.get(_State)
    counted = list(islice(state.measuring, SLICE))
    if counted:
        state.used = counted[-1]
        return SLICE_SECONDS
    state.measuring = None
    windows.redraw("PREFERENCES")
    return None
