"""One engine job in a child process: start, poll, cancel, end. No bpy and no threads; the caller polls.

The child reports in files (see the engine's `wire`); its standard input is lifeline and cancel. A child that says
nothing in time, or ends without a final event, counts as failed; what it wrote last is in its log. A child that has
done a job may wait for the next one (`follow`); one whose job failed or was cancelled always ends.
"""

import contextlib
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..engine_api import (
    CANCEL,
    LOG_FILE,
    Cancelled,
    DataError,
    Event,
    EventReader,
    KarfError,
    MissingDependency,
    Request,
    error_from_code,
    folder_line,
)
from . import processes

HELLO_SECONDS = 180.0  # a first import of torch from a cold disk is slow
CANCEL_SECONDS = 15.0
EXIT_SECONDS = 15.0
LOG_LINES = 30
LOG_BYTES = 20_000  # lines may be long


class Job:
    """A child process at work. `poll` it until `ended`, then `check` how it ended."""

    def __init__(
        self, request: Request, folder: Path, process: subprocess.Popen, hello_seconds: float, wait_seconds: float = 0
    ) -> None:
        self.request = request
        self.folder = folder
        self.ended = False
        self._process = process
        self._wait_seconds = wait_seconds
        self._waits_until = float("-inf")
        self._reader = EventReader(folder)
        self._final: Event | None = None
        self._hello_by = time.monotonic() + hello_seconds
        self._silent = False
        self._is_cancelled = False
        # (when, signal) to send if the child is still there
        self._planned: list[tuple[float, int]] = []

    def poll(self) -> list[Event]:
        """The events since the last call. Also enforces the deadlines. Never blocks."""
        # the exit is asked for first, so that all events written before it are read
        has_exited = self._process.poll() is not None
        events = self._new_events()
        if events:
            self._hello_by = float("inf")
        for event in events:
            if event.is_final:
                self._final = event
                self._end_after(EXIT_SECONDS)
        now = time.monotonic()
        if self._wait_seconds and not self._is_cancelled and self._final is not None and self._final.kind == "done":
            self._waits_until = now + self._wait_seconds / 2  # well before the child ends by itself
            self.ended = True
        elif has_exited:
            self._close()
            # what it started may have outlived it
            processes.send(self._process, processes.KILL)
            self.ended = True
        elif now > self._hello_by:
            self._silent = True
            self._hello_by = float("inf")
            self._end_after(0.0)
        elif self._planned and now > self._planned[0][0]:
            processes.send(self._process, self._planned.pop(0)[1])
        return events

    def cancel(self) -> None:
        """Ask the child to stop at its next safe point; it is ended by force where it does not."""
        self._is_cancelled = True
        self.tell(CANCEL)
        self._end_after(CANCEL_SECONDS)

    def tell(self, line: str) -> None:
        """Write a line to the child's standard input; a child that is gone is noticed by `poll`."""
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(f"{line}\n".encode())
            self._process.stdin.flush()

    @property
    def is_waiting(self) -> bool:
        """Whether the job is done and its child waits for the next one."""
        return time.monotonic() < self._waits_until and self._process.poll() is None

    def follow(self, request: Request, folder: Path) -> "Job":
        """Give the child, which waits, its next job; this one must not be polled any more.

        Raises:
            DataError: The folder cannot be written.
        """
        with disk_errors():
            request.write(folder)
        job = Job(request, folder, self._process, HELLO_SECONDS, self._wait_seconds)
        job.tell(folder_line(folder))
        return job

    def terminate(self) -> None:
        """End the child now; waits for it a few seconds at most."""
        self._close()
        processes.end(self._process)
        self.ended = True

    def check(self) -> None:
        """Return where the ended job is done.

        Raises:
            KarfError: It is not: the job's own error, or how it ended without one.
        """
        stage, how = self.request.stage, processes.ending(self._process)
        if self._silent:
            raise MissingDependency("The engine did not answer after its start.", "Try Test Engine in the preferences.")
        if self._final is None and not self.folder.is_dir():
            raise DataError(
                f"{self.folder} was taken away while the {stage} job ran.", "Bring the project back and try again."
            )
        if self._final is None and self._is_cancelled:
            raise Cancelled(f"The {stage} job did not stop by itself and was ended ({how}).")
        if self._final is None:
            raise KarfError(
                f"The engine crashed in the {stage} job ({how}).",
                "Most likely memory ran out: use a smaller preset, or fewer threads."
                if how == "SIGKILL"
                else "Its log tells more.",
            )
        if self._final.kind == "cancelled":
            raise Cancelled(f"The {stage} job was cancelled.")
        if self._final.kind == "error":
            raise error_from_code(self._final["code"], self._final["sentence"], self._final.get("hint") or "")

    def log_tail(self) -> str:
        """The last lines that the child wrote beside its events."""
        return log_tail(self.folder)

    def _new_events(self) -> list[Event]:
        try:
            return list(self._reader.poll())
        except OSError:  # the folder may be taken away while the child lives; its end is seen all the same
            return []

    def _end_after(self, seconds: float) -> None:
        if not self._planned:
            first = time.monotonic() + seconds
            self._planned = [(first, signal.SIGTERM), (first + processes.TERMINATE_SECONDS, processes.KILL)]

    def _close(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.close()


def start(
    python: Path,
    engine: Path,
    request: Request,
    folder: Path,
    threads: int = 0,
    hello_seconds: float = HELLO_SECONDS,
    wait_seconds: float = 0,
) -> Job:
    """Start a job in its own empty folder.

    Args:
        python: The Python that has the engine's packages.
        engine: The engine's folder, which that Python executes.
        request: What is asked; it is written into the folder.
        folder: The job's own folder.
        threads: Processor threads; 0: the engine chooses.
        hello_seconds: How long the engine may be silent after its start.
        wait_seconds: How long the child waits for the next job once this one is done.

    Raises:
        MissingDependency: The Python cannot be started.
        DataError: The folder cannot be written.
    """
    with disk_errors():
        request.write(folder)
        log = (folder / LOG_FILE).open("ab")
    waiting = ("--wait", str(wait_seconds)) if wait_seconds else ()
    command = processes.engine_command(python, engine, "run", folder, *waiting)
    try:
        with log:
            process = processes.start(
                command, threads, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, cwd=folder
            )
    except OSError as error:
        raise MissingDependency(
            f"{python} cannot be started ({error}).", "Set Engine Python in the KaRF preferences."
        ) from error
    return Job(request, folder, process, hello_seconds, wait_seconds)


def log_tail(folder: Path) -> str:
    """The last lines of a job's log; empty where there is none. Never raises."""
    try:
        with (folder / LOG_FILE).open("rb") as stream:
            stream.seek(max(0, stream.seek(0, 2) - LOG_BYTES))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return "\n".join(lines[-LOG_LINES:])


def disk_error(error: OSError) -> DataError:
    """What the operating system refuses, as a sentence that names the file."""
    return DataError(
        f"{error.filename or 'The disk'}: {error.strerror or error}.",
        "Is there space, is the drive connected, and may you write there? Else choose another folder.",
    )


@contextmanager
def disk_errors() -> Iterator[None]:
    """Turn what the operating system refuses inside this block into a DataError."""
    try:
        yield
    except OSError as error:
        raise disk_error(error) from error
