"""Ask a Python whether it can run the engine: its doctor as a child process. No bpy and no threads."""

import subprocess
import tempfile
import time
from pathlib import Path
from typing import IO

from ..engine_api import ERROR, VERDICT, Finding
from . import processes

TIMEOUT = 300.0  # seconds without a finding: a first import of torch from a cold disk is slow, and so may a stage be
WAIT_SECONDS = 0.05


class Examination:
    """The findings as they come: `poll` it until it has ended. It never fails: what goes wrong is a finding too.

    Args:
        python: The one to ask.
        engine: The engine's folder, which that Python executes.
        folder: Of projects, there or not.
        threads: Processor threads; 0: the engine chooses.
    """

    def __init__(self, python: Path, engine: Path, folder: Path, threads: int = 0) -> None:
        self.python = python
        self.findings: tuple[Finding, ...] = ()
        self.has_ended = False
        self._end_by = time.monotonic() + TIMEOUT
        # files take any amount of words; a pipe that nobody reads would hold the child up
        self._said, self._errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()
        command = processes.engine_command(python, engine, "doctor", "--json", "--folder", folder)
        command += ["--threads", str(threads)] if threads else []
        try:
            self._process = processes.start(
                command, threads, stdin=subprocess.DEVNULL, stdout=self._said, stderr=self._errors
            )
        except OSError as error:
            self._give_up(f"{python} cannot be started ({error}).")

    def poll(self) -> bool:
        """Take in what was found since the last call; True at the end. Never blocks."""
        if self.has_ended:
            return True
        # poll the exit first, so that nothing written before it is missed
        code = self._process.poll()
        if new := self._new_findings():
            self.findings += new
            self._end_by = time.monotonic() + TIMEOUT
        if code is not None:
            self._conclude()
        elif time.monotonic() > self._end_by:
            self.end()
            self._give_up(f"{self.python} gave no answer in {TIMEOUT:.0f} seconds{self._place()}.")
        return self.has_ended

    def end(self) -> None:
        if not self.has_ended:
            processes.end(self._process)
            self.has_ended = True

    def _new_findings(self) -> tuple[Finding, ...]:
        """Read whole lines only."""
        lines = [line for line in _read(self._said).splitlines(keepends=True) if line.endswith("\n")]
        found = []
        for line in lines:
            try:
                found.append(Finding.from_line(line))
            except ValueError:  # a library printed something
                continue
        return tuple(found[len(self.findings) :])

    def _conclude(self) -> None:
        self.has_ended = True
        if self.findings and self.findings[-1].name == VERDICT:
            return
        reason = (_read(self._errors).strip().splitlines() or [processes.ending(self._process)])[-1]
        what = "stopped" if self.findings else "cannot run the engine"
        self._give_up(f"{self.python} {what}{self._place()} ({reason}).")

    def _place(self) -> str:
        return f" after {self.findings[-1].name}" if self.findings else ""

    def _give_up(self, sentence: str) -> None:
        self.has_ended = True
        remedy = "Install its packages anew, or choose another Python." if self.findings else "Choose another Python."
        self.findings += (Finding(VERDICT, ERROR, sentence, remedy),)


def _read(stream: IO[bytes]) -> str:
    stream.seek(0)
    return stream.read().decode("utf-8", "replace")


def examine(python: Path, engine: Path, folder: Path, threads: int = 0) -> Examination:
    """Ask a Python and block until it has answered; arguments as for `Examination`."""
    examination = Examination(python, engine, folder, threads)
    try:
        while not examination.poll():
            time.sleep(WAIT_SECONDS)
    finally:
        examination.end()
    return examination
