"""The test of the engine's Python: its doctor, alongside the interface or blocking."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import session
from ..engine_api import ERROR, VERDICT, Finding
from ..host import windows
from .processes import Inquiry

TIMEOUT = 300.0  # seconds without a finding: a first import of torch from a cold disk is slow, and so may a stage be
POLL_SECONDS = 0.2


class Examination:
    """The findings as they come: `poll` it until it has ended. It never fails: what goes wrong is a finding too."""

    def __init__(self, python: Path, folder: Path, threads: int) -> None:
        self.python = python
        self.findings: tuple[Finding, ...] = ()
        self.has_ended = False
        self._end_by = time.monotonic() + TIMEOUT
        try:
            self._inquiry = Inquiry(python, "doctor", "--json", "--folder", folder, threads=threads)
        except OSError as error:
            self._give_up(f"{python} cannot be started ({error}).")

    def poll(self) -> bool:
        """Take in what was found since the last call; True at the end. Never blocks."""
        if self.has_ended:
            return True
        # poll the exit first, so that nothing written before it is missed
        has_exited = self._inquiry.process.poll() is not None
        found = tuple(_findings(self._inquiry.lines()))
        if found != self.findings:
            self.findings, self._end_by = found, time.monotonic() + TIMEOUT
        after = f" after {found[-1].name}" if found else ""
        if has_exited and found and found[-1].name == VERDICT:
            self.has_ended = True
        elif has_exited:
            what = "stopped" if found else "cannot run the engine"
            self._give_up(f"{self.python} {what}{after} ({self._inquiry.reason()}).")
        elif time.monotonic() > self._end_by:
            self.end()
            self._give_up(f"{self.python} gave no answer in {TIMEOUT:.0f} seconds{after}.")
        return self.has_ended

    def end(self) -> None:
        if not self.has_ended:
            self._inquiry.end()
            self.has_ended = True

    def _give_up(self, sentence: str) -> None:
        self.has_ended = True
        remedy = "Install its packages anew, or choose another Python." if self.findings else "Choose another Python."
        self.findings += (Finding(VERDICT, ERROR, sentence, remedy),)


def _findings(lines: Iterable[str]) -> Iterator[Finding]:
    for line in lines:
        try:
            yield Finding.from_line(line)
        except ValueError:  # a library printed something
            continue


@dataclass
class _State:
    examination: Examination | None = None  # the last one, which may be running

    def close(self) -> None:
        if self.examination is not None:
            self.examination.end()
            self.examination = None


def is_running() -> bool:
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
    """Test a Python alongside the interface, or block in background mode; `folder`: of projects, there or not."""
    if bpy.app.background:
        wait(python, folder, threads)
    else:
        _begin(python, folder, threads)
        session.start_timer(_tick, POLL_SECONDS, persistent=True)


def wait(python: Path, folder: Path, threads: int = 0) -> tuple[Finding, ...]:
    """Test a Python as `launch` does, but always block; return what was found."""
    examination = _begin(python, folder, threads)
    try:
        while not examination.poll():
            time.sleep(POLL_SECONDS / 4)
    finally:  # also where the user interrupts with Ctrl-C
        examination.end()
    return examination.findings


def cancel() -> None:
    """End the test that is running and forget what was found; no child and no timer is left."""
    session.stop_timer(_tick)
    session.get(_State).close()


def _begin(python: Path, folder: Path, threads: int) -> Examination:
    cancel()
    examination = session.get(_State).examination = Examination(python, folder, threads)
    return examination


def _tick() -> float | None:
    examination = session.get(_State).examination
    before, has_ended = examination.findings, examination.poll()
    if has_ended or examination.findings != before:
        windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return None if has_ended else POLL_SECONDS
