"""The test of the engine's Python: alongside the interface, or blocking in background mode, where timers never fire.

Findings belong to one Python and to this session.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import engine_api, session
from ..engine_api import VERDICT, Finding
from ..host import windows
from . import examination
from .examination import Examination

POLL_SECONDS = 0.2


@dataclass
class _State:
    examination: Examination | None = None  # the last one, which may be running

    def close(self) -> None:
        """End the test, and its child."""
        if self.examination is not None:
            self.examination.end()
            self.examination = None


def is_running() -> bool:
    """True while a Python is being asked."""
    known = session.get(_State).examination
    return known is not None and not known.has_ended


def findings_on(python: Path | None) -> tuple[Finding, ...]:
    """Return what the last test has found so far, if it was of this Python."""
    known = session.get(_State).examination
    return known.findings if known is not None and known.python == python else ()


def verdict_on(python: Path | None) -> Finding | None:
    """Return what the last test of this Python came to; None before its end."""
    found = findings_on(python)
    return found[-1] if found and found[-1].name == VERDICT else None


def launch(python: Path, folder: Path, threads: int = 0) -> None:
    """Test a Python alongside the interface and return at once; in background mode, block until it is done.

    `folder` is that of projects, there or not; with 0 threads the engine chooses.
    """
    if bpy.app.background:
        session.get(_State).examination = examination.examine(python, engine_api.ENGINE_FOLDER, folder, threads)
        return
    _begin(python, folder, threads)
    session.start_timer(_tick, POLL_SECONDS, persistent=True)


def cancel() -> None:
    """End the test that is running and forget what was found; no child and no timer is left."""
    session.stop_timer(_tick)
    session.get(_State).close()


def _begin(python: Path, folder: Path, threads: int) -> None:
    cancel()
    session.get(_State).examination = Examination(python, engine_api.ENGINE_FOLDER, folder, threads)


def _tick() -> float | None:
    """The timer: takes in what was found, and stops itself at the end."""
    examination = session.get(_State).examination
    before, has_ended = examination.findings, examination.poll()
    if has_ended or examination.findings != before:
        windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None if has_ended else POLL_SECONDS
