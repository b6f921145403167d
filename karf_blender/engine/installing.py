"""The engine's installation and removal: alongside the interface, or blocking in background mode, where timers never fire."""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from .. import session
from ..engine_api import BadRequest, KarfError
from ..host import windows
from .installer import home
from .installer.installation import Installation, Progress, Removal
from .installer.plan import Choices, Plan, make

POLL_SECONDS = 0.3
PRINT_SECONDS = 5.0


@dataclass
class _State:
    work: Installation | Removal | None = None
    error: KarfError | None = None  # how the last one failed or was cancelled

    def close(self) -> None:
        if self.work is not None:
            self.work.end()
            self.work = None


def plan(choices: Choices) -> Plan:
    """Plan an installation with this Blender's Python and as its preferences allow; raises KarfError."""
    return make(choices, sys.executable, bpy.app.online_access)


def is_running() -> bool:
    return session.get(_State).work is not None


def can_be_cancelled() -> bool:
    """Return True while an installation is at work; a removal cannot be cancelled."""
    work = session.get(_State).work
    return work is not None and work.can_be_cancelled


def progress() -> Progress | None:
    """Return how far it is; None while none is at work."""
    work = session.get(_State).work
    return work.progress if work else None


def last_error() -> KarfError | None:
    """Return how the last one failed or was cancelled; None where it did not."""
    return session.get(_State).error


def launch(planned: Plan) -> None:
    """Install alongside the interface and return at once; in background mode, block until it is done.

    Raises KarfError where it cannot start; in background mode also where it fails.
    """
    if bpy.app.background:
        wait(planned)
    else:
        _begin(Installation, planned)
        session.start_timer(_tick, POLL_SECONDS, persistent=True)


def wait(planned: Plan) -> None:
    """Install, print how far it is, and block until it is done; raises KarfError where it fails."""
    installation = _begin(Installation, planned)
    printed, quiet_until = "", 0.0
    try:
        while not installation.ended:
            now = installation.poll()
            if now.title != printed or time.monotonic() > quiet_until:
                printed, quiet_until = now.title, time.monotonic() + PRINT_SECONDS
                print(f"KaRF engine: {now.sentence}", flush=True)
            time.sleep(POLL_SECONDS / 2)
        installation.check()
    finally:  # also where the user interrupts with Ctrl-C
        session.get(_State).close()


def remove(folder: Path) -> None:
    """Delete the environment in a folder and return at once; in background mode, block until it is done.

    Raises KarfError where the folder is not KaRF's; in background mode also where a file cannot be deleted.
    """
    if bpy.app.background:
        home.remove(folder)
    else:
        _begin(Removal, folder)
        session.start_timer(_tick, persistent=True)


def cancel() -> None:
    """Ask the installation to stop; downloaded files are kept."""
    if not can_be_cancelled():
        raise BadRequest("No installation is running.", "")
    session.get(_State).work.end()


def _begin(kind: type, *arguments: Any) -> Installation | Removal:
    state = session.get(_State)
    if state.work is not None:
        raise BadRequest("The engine is already being installed.", "Wait for it, or cancel it.")
    state.work, state.error = kind(*arguments), None
    return state.work


def _tick() -> float | None:
    """The timer: lets the work continue, and stops itself when it has ended."""
    state = session.get(_State)
    if state.work is None:
        return None
    state.work.poll()
    windows.redraw("PREFERENCES")
    if not state.work.ended:
        return POLL_SECONDS
    try:
        state.work.check()
    except KarfError as error:
        state.error = error
    state.work = None
    windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None
