"""The engine's worker, a child process: jobs one after another, queries, and cancel. No bpy, no threads: the caller polls.

It reports in files (see the engine's `worker.protocol`); its standard input is lifeline and cancel. Starting takes two
seconds, most of them to load torch, so a worker may be kept for a while after a job is done. After a failed or
cancelled job, or for other settings, a new one is started.
"""

import contextlib
import os
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import engine_api
from ..engine_api import (
    CANCEL,
    LOG_FILE,
    Cancelled,
    DataError,
    Event,
    EventReader,
    KarfError,
    MissingDependency,
    Query,
    Request,
    error_from_code,
    folder_line,
)
from . import processes
from .failures import disk_errors

HELLO_SECONDS = 180.0  # a first import of torch from a cold disk is slow
CANCEL_SECONDS = 15.0
EXIT_SECONDS = 15.0
REPLIES = ("answer", "refused", "dropped")


@dataclass
class _Job:
    request: Request
    folder: Path
    reader: EventReader
    hello_by: float  # when the worker must have said something
    final: Event | None = None  # its last event
    is_silent: bool = False
    is_cancelled: bool = False
    has_ended: bool = False
    planned: list[tuple[float, int]] = field(default_factory=list)  # (when, signal) to send where it still runs

    def end_after(self, seconds: float) -> None:
        if not self.planned:
            first = time.monotonic() + seconds
            self.planned = [(first, signal.SIGTERM), (first + processes.TERMINATE_SECONDS, processes.KILL)]


class Worker:
    """A worker: `begin` a job, `poll` until it has `ended`, `check` how it ended; then begin the next, or `end`.

    The process waits `keep_seconds` for the next job after one that is done; with 0 it ends.
    """

    def __init__(self, keep_seconds: float = 0, hello_seconds: float = HELLO_SECONDS) -> None:
        self.unanswered: dict[int, Any] = {}  # what the caller noted of queries without reply, by their numbers
        self._keep_seconds, self._hello_seconds = keep_seconds, hello_seconds
        self._process: subprocess.Popen | None = None
        self._made_for: tuple[Any, ...] = ()
        self._waits_until = float("-inf")
        self._job: _Job | None = None
        self._unsent: dict[str, Query] | None = {}  # until the worker listens; None since
        self._n_queries = 0

    # --- jobs ------------------------------------------------------------------------------------------------------
    def begin(self, python: Path, request: Request, folder: Path, threads: int = 0) -> None:
        """Begin a job in its own folder, new or empty, in the process that waits for one where it still serves.

        No other job may be at work. With 0 threads the engine chooses. Raises MissingDependency where the Python does
        not start, DataError where the folder cannot be written.
        """
        with disk_errors():
            request.write(folder)
        if self.is_waiting and self.suits(python, threads):
            self._send(folder_line(folder))
        else:
            self.end()
            self._process = self._start(python, folder, threads)
            self._made_for = _settings(python, threads)
        self._waits_until, self._unsent = float("-inf"), {}
        self._job = _Job(request, folder, EventReader(folder), time.monotonic() + self._hello_seconds)

    def poll(self) -> list[Event]:
        """Return the job's events since the last call, and enforce the deadlines. Never blocks."""
        job = self._job
        if job.has_ended:
            return []
        # poll the exit first, so that no event written before it is missed
        has_exited = self._process.poll() is not None
        events = self._new_events()
        if events:
            job.hello_by = float("inf")
        for event in events:
            if event.kind == "hello":
                self._send_queries()
            if event.is_final:
                job.final = event
                job.end_after(EXIT_SECONDS)
        now = time.monotonic()
        if self._keep_seconds and not job.is_cancelled and job.final is not None and job.final.kind == "done":
            self._waits_until = now + self._keep_seconds / 2  # well before the process ends by itself
            job.has_ended = True
        elif has_exited:
            self._close()
            # what it started may have outlived it
            processes.send(self._process, processes.KILL)
            job.has_ended = True
        elif now > job.hello_by:
            job.is_silent = True
            job.hello_by = float("inf")
            job.end_after(0.0)
        elif job.planned and now > job.planned[0][0]:
            processes.send(self._process, job.planned.pop(0)[1])
        return events

    def cancel(self) -> None:
        """Ask the worker to stop its job at the next safe point; end it by force where it does not."""
        self._job.is_cancelled = True
        self._send(CANCEL)
        self._job.end_after(CANCEL_SECONDS)

    def check(self) -> None:
        """Raise KarfError where the ended job is not done: its own error, or how it ended without one."""
        job, how = self._job, processes.ending(self._process)
        stage = job.request.stage
        if job.is_silent:
            raise MissingDependency("The engine did not answer after its start.", "Try Test Engine in the preferences.")
        if job.final is not None and job.final.kind == "cancelled":
            raise Cancelled("The {stage} job was cancelled.", stage=stage)
        if job.final is not None and job.final.kind == "error":
            raise error_from_event(job.final)
        if job.final is not None:
            return
        if not job.folder.is_dir():
            raise DataError(
                "{folder} was removed while the {stage} job was running.",
                "Restore the project and try again.",
                folder=job.folder,
                stage=stage,
            )
        if job.is_cancelled:
            raise Cancelled("The {stage} job did not stop and was killed ({how}).", stage=stage, how=how)
        hint = "See its log for details."
        if how == "SIGKILL":
            hint = "It most likely ran out of memory: use a smaller preset, or fewer threads."
        raise KarfError("The engine crashed in the {stage} job ({how}).", hint, stage=stage, how=how)

    # of the job at work, or of the last one
    @property
    def request(self) -> Request:
        return self._job.request

    @property
    def folder(self) -> Path:
        return self._job.folder

    @property
    def ended(self) -> bool:
        return self._job is None or self._job.has_ended

    # --- queries ---------------------------------------------------------------------------------------------------
    def query(self, kind: str, options: dict[str, Any], note: Any) -> None:
        """Send a query to a worker whose job answers them; one of the same kind that was not begun is dropped."""
        self._n_queries += 1
        query = Query(self._n_queries, kind, options)
        self.unanswered[query.number] = note
        if self._unsent is None:
            self._send(query.encode())
            return
        # nobody reads the pipe yet, and it takes only so much
        replaced = self._unsent.pop(kind, None)
        self._unsent[kind] = query
        if replaced is not None:
            del self.unanswered[replaced.number]

    def replies(self) -> list[tuple[Any, Event]]:
        """Poll; return (note of the query, event) for what was answered, refused or dropped."""
        events = [event for event in self.poll() if event.kind in REPLIES and event["id"] in self.unanswered]
        return [(self.unanswered.pop(event["id"]), event) for event in events]

    # --- the process -----------------------------------------------------------------------------------------------
    @property
    def is_waiting(self) -> bool:
        return time.monotonic() < self._waits_until and self._process.poll() is None

    def suits(self, python: Path, threads: int) -> bool:
        """Return whether the process was made for these settings and today's environment variables."""
        return self._made_for == _settings(python, threads)

    def end(self) -> None:
        """End the process now, at work or waiting; waits for it a few seconds at most."""
        if self._process is not None:
            self._close()
            processes.end(self._process)
        if self._job is not None:
            self._job.has_ended = True

    def _start(self, python: Path, folder: Path, threads: int) -> subprocess.Popen:
        waiting = ("--wait", str(self._keep_seconds)) if self._keep_seconds else ()
        command = processes.engine_command(python, "run", folder, *waiting)
        with disk_errors():
            log = (folder / LOG_FILE).open("ab")
        try:
            with log:
                return processes.start(
                    command, threads, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, cwd=folder
                )
        except OSError as error:
            raise MissingDependency(
                "{python} cannot be started ({error}).",
                "Set Engine Python in the KaRF preferences.",
                python=python,
                error=error,
            ) from error

    def _send(self, line: str) -> None:
        """Write a line to standard input; a worker that is gone is noticed by `poll`."""
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write(f"{line}\n".encode())
            self._process.stdin.flush()

    def _send_queries(self) -> None:
        for query in (self._unsent or {}).values():
            self._send(query.encode())
        self._unsent = None

    def _new_events(self) -> list[Event]:
        try:
            return list(self._job.reader.poll())
        except OSError:  # the folder may be taken away while the worker lives; its end is seen all the same
            return []

    def _close(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.close()


def _settings(python: Path, threads: int) -> tuple[Any, ...]:
    return python, engine_api.ENGINE_FOLDER, processes.child_environment(os.environ, threads)


def error_from_event(event: Event) -> KarfError:
    """Return the error of an `error` or a `refused` event."""
    return error_from_code(event["code"], event["sentence"], event.get("hint") or "")
