"""The test of the engine's Python: alongside the interface, or blocking in background mode, where timers never fire.

What was found belongs to the Python that was asked and to this session.
"""

from pathlib import Path

import bpy

from .. import engine_api
from ..engine_api import VERDICT, Finding
from ..host import windows
from . import examination
from .examination import Examination

POLL_SECONDS = 0.2


class _Memory:
    """The last test, which may be running."""

    examination: Examination | None = None


def is_running() -> bool:
    """True while a Python is being asked."""
    return _Memory.examination is not None and not _Memory.examination.has_ended


def findings_on(python: Path | None) -> tuple[Finding, ...]:
    """What the last test has found so far, if it was of this Python."""
    known = _Memory.examination
    return known.findings if known is not None and known.python == python else ()


def verdict_on(python: Path | None) -> Finding | None:
    """What the last test of this Python came to; None before its end."""
    found = findings_on(python)
    return found[-1] if found and found[-1].name == VERDICT else None


def launch(python: Path, folder: Path, threads: int = 0) -> None:
    """Test a Python alongside the interface and return at once; in background mode, block until it is done.

    Args:
        python: Which one.
        folder: Where projects lie or would lie.
        threads: Of the engine; 0: it chooses.
    """
    if bpy.app.background:
        _Memory.examination = examination.examine(python, engine_api.ENGINE_FOLDER, folder, threads)
        return
    _begin(python, folder, threads)
    bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)


def cancel() -> None:
    """End the test that is running and forget what was found; no child and no timer is left."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _Memory.examination is not None:
        _Memory.examination.end()
        _Memory.examination = None


def _begin(python: Path, folder: Path, threads: int) -> None:
    cancel()
    _Memory.examination = Examination(python, engine_api.ENGINE_FOLDER, folder, threads)


def _tick() -> float | None:
    """The timer: takes in what was found, and stops itself at the end."""
    before = _Memory.examination.findings
    has_ended = _Memory.examination.poll()
    if has_ended or _Memory.examination.findings != before:
        windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None if has_ended else POLL_SECONDS
