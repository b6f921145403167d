"""A worker: read messages from standard input, serve a job, then wait for the next one (see `protocol`)."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import queue
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..commands.dispatch import run_command
from ..commands.options import options_of_job
from ..compute.progress import Emit
from ..errors import BadRequest, Cancelled, DataError, KarfError, OutOfMemory
from ..io.failures import as_karf_error, print_error
from ..io.options import Options, option
from ..project import STAGE_ORDER, Project
from ..version import __version__
from .path_map import PathMap
from .protocol import CANCEL, LOG_FILE, PROTOCOL, WARM, EventWriter, Query, Request, decode_line

if TYPE_CHECKING:
    from .queries.session import Session

SAME_PATHS = PathMap()


@dataclass(frozen=True, kw_only=True)
class WarmOptions(Options):
    """Answer queries about projects until none arrives for a while."""

    command: ClassVar[str] = WARM

    idle_minutes: int = option("how long to wait for the next query", 10, minimum=0, maximum=1440)


class Inbox:
    """Messages that a worker reads from standard input: job folders in order, and the latest query of each kind.

    Emits `dropped` for a query that a later one of its kind replaces, and `warning` for any other line.
    """

    def __init__(self, emit: Emit) -> None:
        self._emit = emit
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()  # None: end of input
        self._folders: deque[str] = deque()
        self._queries: dict[str, Query] = {}
        self._cancelled = threading.Event()

    def listen(self, lines: Iterable[str]) -> None:
        """Start a thread that reads a stream."""
        threading.Thread(target=self._read, args=(lines,), daemon=True).start()

    def is_cancelled(self) -> bool:
        """Return whether the line `cancel` or the end of input (the caller is gone) has arrived."""
        return self._cancelled.is_set()

    def next_folder(self, seconds: float) -> str | None:
        """Wait for the folder of the next job; return None on timeout or cancel."""
        self._sort()
        while not self._folders and self._wait(seconds):
            pass
        return None if self.is_cancelled() or not self._folders else self._folders.popleft()

    def next_query(self, seconds: float) -> Query | None:
        """Wait for a query and return the oldest; return None on timeout or cancel, or if a job is waiting."""
        self._sort()
        while not self._queries and not self._folders and self._wait(seconds):
            pass
        if self.is_cancelled() or not self._queries:
            return None
        return self._queries.pop(next(iter(self._queries)))

    def is_superseded(self, kind: str) -> bool:
        """Return whether a later query of this kind is waiting, or the caller is gone."""
        self._sort()
        return kind in self._queries or self.is_cancelled()

    def _wait(self, seconds: float) -> bool:
        """Wait for a line and sort all lines that arrived; return False on timeout or cancel."""
        if self.is_cancelled():
            return False
        try:
            self._add(self._lines.get(timeout=seconds))
        except queue.Empty:
            return False
        self._sort()
        return True

    def _sort(self) -> None:
        while not self._lines.empty():
            self._add(self._lines.get())

    def _add(self, line: str | None) -> None:
        if line is None:
            return
        try:
            message = decode_line(line)
        except BadRequest as error:
            self._emit("warning", code=error.code, sentence=error.sentence)
            return
        if isinstance(message, str):
            self._folders.append(message)
            return
        replaced = self._queries.pop(message.kind, None)
        self._queries[message.kind] = message
        if replaced is not None:
            self._emit("dropped", id=replaced.number)

    def _read(self, lines: Iterable[str]) -> None:
        for line in lines:
            if line.strip() == CANCEL:
                break
            self._lines.put(line)
        self._cancelled.set()
        self._lines.put(None)


class Worker:
    """A process that serves job folders, one or, with `wait_seconds` for the next, several."""

    def __init__(self, paths: PathMap = SAME_PATHS, wait_seconds: float = 0) -> None:
        self._paths, self._wait_seconds = paths, wait_seconds
        self._events: EventWriter | None = None  # of the current job
        self._inbox = Inbox(self._emit)

    def serve(self, job: Path, lines: Iterable[str]) -> int:
        """Serve a job folder, and those that follow it in the lines of standard input; return the last exit code."""
        self._inbox.listen(lines)
        code = self._serve_one(job)
        while code == 0 and self._wait_seconds:
            _release_resources()
            folder = self._inbox.next_folder(self._wait_seconds)
            if folder is None:
                break
            job = Path(self._paths.to_local(folder))
            _redirect_stdio(job, job / LOG_FILE)
            code = self._serve_one(job)
        return code

    def _serve_one(self, job: Path) -> int:
        if not job.is_dir():
            raise DataError(f"{job} is not a job folder.", "Give the folder that holds request.json.")
        self._events = EventWriter(job)
        try:
            self._emit("hello", protocol=PROTOCOL, engine=__version__, python=platform.python_version(),
                       torch=_version("torch"), pid=os.getpid())  # fmt: skip
            request = Request.read(job)
            folder, options = Path(self._paths.to_local(str(request.project))), self._paths.to_local(request.options)
            if request.stage == WARM:
                self._answer_queries(job, WarmOptions.from_json(options))
            else:
                command = options_of_job(request.stage, folder, options)
                run_command(command, self._emit, self._inbox.is_cancelled)
            self._emit("done", summary=_summary(Project(folder)))
        except Exception as raised:
            error = as_karf_error(raised)
            self._emit_end(error)
            return error.exit_code
        finally:
            self._events = None
        return 0

    def _answer_queries(self, job: Path, options: WarmOptions) -> None:
        """Answer queries until none arrives for a while, the caller cancels, or a job is waiting."""
        from .queries.session import Session

        session = Session(job, options.threads, options.device)
        while (query := self._inbox.next_query(60 * options.idle_minutes)) is not None:
            self._answer(session, query)

    def _answer(self, session: Session, query: Query) -> None:
        from .queries import answer  # needs numpy, and the command line must start without it

        is_superseded = partial(self._inbox.is_superseded, query.kind)
        try:
            values = answer(session, query.kind, self._paths.to_local(query.options), is_superseded)
            self._emit("answer", id=query.number, **values)
        except Cancelled:
            self._emit("dropped", id=query.number)
        except Exception as raised:
            error = as_karf_error(raised)
            if isinstance(error, OutOfMemory):
                session.forget()
            self._emit("refused", id=query.number, code=error.code, sentence=error.sentence, hint=error.hint)

    def _emit(self, kind: str, /, **values: Any) -> None:
        """Append to the events of the current job; between jobs, do nothing."""
        if self._events is not None:
            self._events(kind, **self._paths.to_caller(values))

    def _emit_end(self, error: KarfError) -> None:
        """Emit the last event of a failed job, or print it where the events cannot be written."""
        try:
            if error.code == "cancelled":
                self._emit("cancelled", sentence=error.sentence)
            else:
                self._emit("error", code=error.code, sentence=error.sentence, hint=error.hint)
        except OSError:
            print_error(error)


def _release_resources() -> None:
    """Free memory, and leave the job's folder and log, which could not be deleted on Windows while in use."""
    gc.collect()
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_initialized():
        torch.cuda.empty_cache()
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "malloc_trim"):  # not every C library has it
        library.malloc_trim(0)
    _redirect_stdio(Path(tempfile.gettempdir()), Path(os.devnull))


def _redirect_stdio(folder: Path, log: Path) -> None:
    """Change to a folder and redirect standard output and error to a file."""
    os.chdir(folder)
    sys.stdout.flush()
    sys.stderr.flush()
    with log.open("ab") as stream:
        for number in (1, 2):
            os.dup2(stream.fileno(), number)


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _summary(project: Project) -> dict:
    """Return the summaries of the project's finished stages."""
    if not project.state_file.exists():  # some commands have no project
        return {}
    return {stage: facts for stage in STAGE_ORDER if (facts := project.finished(stage))}
