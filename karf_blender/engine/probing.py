"""The test of the engine's Python: beside the interface, or blocking in background mode, where timers never fire.

Its verdict belongs to the Python that was asked and to this session.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy

from ..engine_api import MissingDependency
from ..host import windows
from . import environment
from .environment import Examination, Probe

POLL_SECONDS = 0.2


@dataclass(frozen=True)
class Verdict:
    """What was found. command: what to type into a terminal where packages are missing, else empty."""

    python: Path
    sentence: str
    command: str
    is_ready: bool


class _Memory:
    """The test that is running, and the last verdict."""

    probe: Probe | None = None
    verdict: Verdict | None = None


def is_running() -> bool:
    """True while a Python is being asked."""
    return _Memory.probe is not None


def verdict_on(python: Path) -> Verdict | None:
    """The last verdict, if it was on this Python."""
    known = _Memory.verdict
    return known if known is not None and known.python == python else None


def launch(python: Path) -> None:
    """Test a Python beside the interface and return at once; in background mode, block until it is done."""
    _Memory.verdict = None
    try:
        if bpy.app.background:
            _Memory.verdict = _favorable(environment.examine(python))
            return
        _begin(python)
        bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)
    except MissingDependency as error:
        _Memory.verdict = unfavorable(python, error)


def cancel() -> None:
    """End the test that is running, without a verdict; no child and no timer is left."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    if _Memory.probe is not None:
        _Memory.probe.end()
        _Memory.probe = None


def _begin(python: Path) -> None:
    cancel()
    _Memory.probe = Probe(python)


def _tick() -> float | None:
    """The timer: asks whether there is an answer, and stops itself when there is."""
    probe = _Memory.probe
    try:
        found = probe.poll()
        if found is None:
            return POLL_SECONDS
        _Memory.verdict = _favorable(found)
    except MissingDependency as error:
        _Memory.verdict = unfavorable(probe.python, error)
    _Memory.probe = None
    windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None


def _favorable(found: Examination) -> Verdict:
    return Verdict(found.python, found.sentence, found.command, not found.missing)


def unfavorable(python: Path, error: MissingDependency) -> Verdict:
    """The verdict on a Python that cannot be used."""
    return Verdict(python, f"{error.sentence} {error.hint}", "", False)
