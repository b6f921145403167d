"""Job folders in a child process: events to their files; cancel, next jobs and asks by standard input (see wire)."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import queue
import sys
import tempfile
import threading
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import Any

from ..commands.dispatch import run_command
from ..commands.options import options_of_job
from ..compute.progress import Emit
from ..errors import DataError, KarfError
from ..path_map import PathMap
from ..project import STAGE_ORDER, Project
from ..version import __version__
from ..wire import CANCEL, LOG_FILE, PROTOCOL, WARM, EventWriter, Request, folder_of_line
from .failing import as_karf_error, say_error

SAME_PATHS = PathMap()


class Orders:
    """What the caller writes on standard input: to stop, and folders of next jobs.

    Args:
        lines: A stream, read in a thread of its own from `listen` on: reading blocks.
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._lines = lines
        self._folders: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)

    def listen(self) -> None:
        """Begin to read, if that is not done yet; a job that is asked things reads its input itself."""
        if not self._thread.ident:
            self._thread.start()

    def is_stopped(self) -> bool:
        """Whether the line `cancel`, or the end of input (the caller is gone), asked to stop."""
        return self._stop.is_set()

    def next_folder(self, seconds: float) -> str | None:
        """The next job's folder; None where none came in so many seconds, or none will."""
        try:
            line = self._folders.get(timeout=seconds)
        except queue.Empty:
            return None
        return None if line is None else folder_of_line(line)

    def _read(self) -> None:
        for line in self._lines:
            if line.strip() == CANCEL:
                break
            self._folders.put(line)
        self._stop.set()
        self._folders.put(None)


def run_jobs(job: Path, paths: PathMap = SAME_PATHS, wait_seconds: float = 0) -> int:
    """Run a job folder as a child process, and those that the caller names while it waits after one that is done.

    Args:
        job: The folder, with its request.
        paths: Of folders that the caller knows by other paths; requests and events have the caller's.
        wait_seconds: How long to wait for the next job.

    Returns:
        The last job's exit code.

    Raises:
        DataError: There is no such folder.
    """
    orders = Orders(sys.stdin)
    code = _run_job(job, orders, paths)
    while code == 0 and wait_seconds:
        _release()
        folder = orders.next_folder(wait_seconds)
        if folder is None:
            break
        job = Path(paths.here(folder))
        _settle(job, job / LOG_FILE)
        code = _run_job(job, orders, paths)
    return code


def _release() -> None:
    """Hold as little as may be while waiting: no memory that others need, no folder or log that a system keeps in use."""
    gc.collect()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_initialized():
        torch.cuda.empty_cache()
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "malloc_trim"):  # not every C library has it
        library.malloc_trim(0)
    _settle(Path(tempfile.gettempdir()), Path(os.devnull))


def _settle(folder: Path, log: Path) -> None:
    """Be in this folder, with this file as standard output and error."""
    os.chdir(folder)
    sys.stdout.flush()
    sys.stderr.flush()
    with log.open("ab") as stream:
        for number in (1, 2):
            os.dup2(stream.fileno(), number)


def _run_job(job: Path, orders: Orders, paths: PathMap) -> int:
    """Run one job; returns the exit code."""
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
            orders.listen()
            options = options_of_job(request.stage, request.project, request.options)
            run_command(options, emit, orders.is_stopped)
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
