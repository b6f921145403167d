"""What the disk held of the engine when it was read last: drawing asks only this.

The code that watches the disk calls `refresh`. In background mode nothing is drawn and timers never fire: there every
question reads the disk.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import bpy

from .. import session
from ..engine.managed import home
from ..engine.managed.home import NONE, Status
from ..engine_api import MissingDependency
from ..host import windows
from . import choices

HAS_TIMER = not bpy.app.background
NOTHING = Status(NONE, "")
SLICE = 50  # folders measured at once
SLICE_SECONDS = 0.05


@dataclass(frozen=True)
class Engine:
    """The engine's Python, and the environment that the extension keeps.

    Attributes:
        python: The chosen one, there or not; None where its path is refused.
        problem: Why no engine can run, with the remedy; empty where one can.
        folder: That of the managed environment.
        managed: What is in it.
    """

    python: Path | None = None
    problem: str = ""
    folder: Path = Path()
    managed: Status = NOTHING

    @property
    def is_managed(self) -> bool:
        """Whether the engine runs in the managed environment."""
        return self.managed.is_usable and self.python == home.Home(self.folder, self.managed.environment).python


@dataclass
class _State:
    """What was read last; how many bytes the managed environment takes, and the measuring that is at work."""

    engine: Engine = Engine()
    used: int | None = None
    measuring: Iterator[int] | None = None


def known() -> Engine:
    """What there was of the engine when the disk was read last."""
    if not HAS_TIMER:
        refresh()
    return session.get(_State).engine


def disk_use() -> int | None:
    """Bytes that the managed environment takes; None while that is not known."""
    return None if session.get(_State).measuring else session.get(_State).used


def refresh() -> bool:
    """Read the disk; True where something has changed. Never raises."""
    before, session.get(_State).engine = session.get(_State).engine, _read()
    if before == session.get(_State).engine:
        return False
    session.get(_State).used = None
    if session.get(_State).engine.managed.is_usable and HAS_TIMER:
        session.get(_State).measuring = home.measure(session.get(_State).engine.folder)
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
    counted = list(islice(session.get(_State).measuring, SLICE))
    if counted:
        session.get(_State).used = counted[-1]
        return SLICE_SECONDS
    session.get(_State).measuring = None
    windows.redraw("PREFERENCES")
    return None
