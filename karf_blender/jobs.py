"""One engine job as a child process: start, poll, cancel, end. No bpy and no threads; the caller polls.

The child reports in files (see the engine's `wire`); its standard input is lifeline and cancel. A child that says
nothing in time, or ends without a final event, counts as failed, and its last log lines are shown.
"""

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path

from .engine_api import LOG_FILE, Event, EventReader, KarfError, MissingDependency, Request, error_from_code

HELLO_SECONDS = 180.0  # a first import of torch from a cold disk is slow
CANCEL_SECONDS = 15.0
EXIT_SECONDS = 15.0
TERMINATE_SECONDS = 5.0
LOG_LINES = 30
LEAKS = ("PYTHON", "LD_LIBRARY_PATH", "LD_PRELOAD", "DYLD_", "OCIO", "BLENDER_")
THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
# Windows has no SIGKILL: there both steps end the process at once
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)


def child_environment(variables: Mapping[str, str], threads: int = 0) -> dict[str, str]:
    """The environment without what would lead another Python to Blender's libraries; threads 0: as it is."""
    kept = {name: value for name, value in variables.items() if not name.startswith(LEAKS)}
    if threads:
        kept.update(dict.fromkeys(THREAD_VARIABLES, str(threads)))
    return kept


class Job:
    """A child process at work. `poll` it until `ended`, then `check` how it ended."""

    def __init__(self, request: Request, folder: Path, process: subprocess.Popen, hello_seconds: float) -> None:
        self.request = request
        self.folder = folder
        self.ended = False
        self._process = process
        self._reader = EventReader(folder)
        self._final: Event | None = None
        self._hello_by = time.monotonic() + hello_seconds
        self._silent = False
        # (when, signal) to send if the child is still there
        self._planned: list[tuple[float, int]] = []

    def poll(self) -> list[Event]:
        """The events since the last call. Also enforces the deadlines. Never blocks."""
        # the exit is asked for first, so that all events written before it are read
        has_exited = self._process.poll() is not None
        events = list(self._reader.poll())
        if events:
            self._hello_by = float("inf")
        for event in events:
            if event.is_final:
                self._final = event
                self._end_after(EXIT_SECONDS)
        now = time.monotonic()
        if has_exited:
            self._close()
            self.ended = True
        elif now > self._hello_by:
            self._silent = True
            self._hello_by = float("inf")
            self._end_after(0.0)
        elif self._planned and now > self._planned[0][0]:
            self._signal(self._planned.pop(0)[1])
        return events

    def cancel(self) -> None:
        """Ask the child to stop at its next safe point; it is ended by force where it does not."""
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(b"cancel\n")
            self._process.stdin.flush()
        self._end_after(CANCEL_SECONDS)

    def terminate(self) -> None:
        """End the child now; waits for it a few seconds at most."""
        self._close()
        for number in (signal.SIGTERM, KILL):
            if self._process.poll() is None:
                self._signal(number)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(TERMINATE_SECONDS)
        self.ended = True

    def check(self) -> None:
        """Return where the ended job is done. Raises KarfError otherwise: its own error, or what its crash left."""
        if self._silent:
            raise MissingDependency("The engine did not answer after its start.", self._remains())
        if self._final is None:
            raise KarfError(f"The engine crashed in the {self.request.stage} job ({self._ending()}).", self._remains())
        if self._final.kind == "cancelled":
            raise error_from_code("cancelled", f"The {self.request.stage} job was cancelled.")
        if self._final.kind == "error":
            values = self._final.values
            raise error_from_code(values["code"], values["sentence"], values.get("hint", ""))

    def log_tail(self) -> str:
        """The last lines that the child wrote beside its events."""
        text = (self.folder / LOG_FILE).read_text(encoding="utf-8", errors="replace")
        return "\n".join(text.splitlines()[-LOG_LINES:])

    def _remains(self) -> str:
        return f"Its log is {self.folder / LOG_FILE}; the end:\n{self.log_tail()}"

    def _ending(self) -> str:
        code = self._process.returncode
        return signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"

    def _end_after(self, seconds: float) -> None:
        if not self._planned:
            first = time.monotonic() + seconds
            self._planned = [(first, signal.SIGTERM), (first + TERMINATE_SECONDS, KILL)]

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if os.name == "nt":
                self._process.terminate()
            else:  # the child leads its own group
                os.killpg(self._process.pid, number)

    def _close(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.close()


def start(
    python: Path, engine: Path, request: Request, folder: Path, threads: int = 0, hello_seconds: float = HELLO_SECONDS
) -> Job:
    """Start a job in its own empty folder. Raises MissingDependency where the Python cannot be started."""
    request.write(folder)
    # -B: no compiled files appear in the extension's folder, which updates replace
    command = [str(python), "-I", "-B", "-u", "-X", "utf8", str(engine), "run", str(folder)]
    if os.name == "nt":
        own_group = {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
    else:
        own_group = {"start_new_session": True}
    try:
        with (folder / LOG_FILE).open("ab") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd=folder,
                env=child_environment(os.environ, threads),
                **own_group,
            )
    except OSError as error:
        raise MissingDependency(
            f"{python} cannot be started ({error}).", "Set Engine Python in the KaRF preferences."
        ) from error
    return Job(request, folder, process, hello_seconds)
