"""The engine's process from one job to the next: kept for a moment after a job that is done. No bpy, no threads.

Starting takes two seconds, most of them to load torch. A process that failed, was cancelled, or was made for other
settings takes no further job.
"""

import os
from pathlib import Path
from typing import Any

from .. import engine_api
from ..engine_api import Request
from . import jobs, processes

WAIT_SECONDS = 60.0  # that the process waits; half of it counts on it


class KeptEngine:
    """Starts jobs, one at a time, in the process of the one before where that still serves."""

    def __init__(self) -> None:
        self._last: jobs.Job | None = None
        self._made_for: tuple[Any, ...] = ()

    def start(self, python: Path, request: Request, folder: Path, threads: int = 0) -> jobs.Job:
        """Start a job; arguments and errors are those of `jobs.start`."""
        engine = engine_api.ENGINE_FOLDER
        wanted = python, engine, processes.child_environment(os.environ, threads)
        if self._last is not None and self._last.is_waiting and self._made_for == wanted:
            self._last = self._last.follow(request, folder)
            return self._last
        self.end()
        self._last = jobs.start(python, engine, request, folder, threads, wait_seconds=WAIT_SECONDS)
        self._made_for = wanted
        return self._last

    def end(self) -> None:
        """End the process, at work or waiting."""
        if self._last is not None:
            self._last.terminate()
            self._last = None
