"""A job folder as a child process: events to its file, cancel and asks by standard input (see wire)."""

from __future__ import annotations

import os
import platform
import sys
import threading
from importlib import metadata
from pathlib import Path
from typing import Any

from ..errors import DataError, KarfError
from ..path_map import PathMap
from ..progress import Emit
from ..project import STAGE_ORDER, Project
from ..stages.dispatch import run_request
from ..version import __version__
from ..wire import PROTOCOL, WARM, EventWriter, Request
from .failing import as_karf_error, say_error

SAME_PATHS = PathMap()


def run_job(job: Path, paths: PathMap = SAME_PATHS) -> int:
    """Run a job folder as a child process: events to its file, cancel by standard input.

    Args:
        job: The folder, with its request.
        paths: Of folders that the caller knows by other paths; request and events have the caller's.

    Returns:
        The exit code.

    Raises:
        DataError: There is no such folder.
    """
    if not job.is_dir():
        raise DataError(f"{job} is no job folder.", "Give the folder that holds request.json.")
    write = EventWriter(job)

    def emit(kind: str, /, **values: Any) -> None:
        write(kind, **paths.theirs(values))

    try:
        emit("hello", protocol=PROTOCOL, engine=__version__, python=platform.python_version(), torch=_version("torch"),
             pid=os.getpid())  # fmt: skip
        told = Request.read(job)
        request = Request(told.stage, Path(paths.here(str(told.project))), paths.here(told.options))
        if request.stage == WARM:
            _stay_warm(job, request, emit, paths)
        else:
            cancelled = threading.Event()
            threading.Thread(target=_watch_input, args=(cancelled,), daemon=True).start()
            run_request(request, emit, cancelled.is_set)
        emit("done", summary=_summary(request))
    except Exception as raised:
        error = as_karf_error(raised)
        _tell_end(emit, error)
        return error.exit_code
    return 0


def _stay_warm(job: Path, request: Request, emit: Emit, paths: PathMap) -> None:
    from ..warm.serving import IDLE_MINUTES, serve  # needs numpy, without which `doctor` still has something to say
    from ..warm.session import Session

    request.check_options()
    options = request.options
    session = Session(job, options.get("threads"), options.get("device"))
    serve(session, sys.stdin, emit, as_karf_error, paths, options.get("idle_minutes", IDLE_MINUTES))


def _tell_end(emit: Emit, error: KarfError) -> None:
    """The job's last event; on standard error where the events cannot be written."""
    try:
        if error.code == "cancelled":
            emit("cancelled", sentence=error.sentence)
        else:
            emit("error", code=error.code, sentence=error.sentence, hint=error.hint)
    except OSError:
        say_error(error)


def _version(package: str) -> str | None:
    """Version of an installed package without importing it, or None."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _summary(request: Request) -> dict:
    """What the project notes of the stages that the request ran."""
    project = Project(request.project)
    if not project.state_file.exists():  # poses need no project
        return {}
    return {stage: facts for stage in STAGE_ORDER if (facts := project.finished(stage))}


def _watch_input(cancelled: threading.Event) -> None:
    """The line `cancel`, or the end of input (the caller is gone), asks the job to stop."""
    for line in sys.stdin:
        if line.strip() == "cancel":
            break
    cancelled.set()
