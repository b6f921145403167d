"""A worker's loop: serve a job, then wait for the next one (see `protocol`)."""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..commands.dispatch import run_command
from ..commands.options import options_of_job
from ..compute.progress import Emit
from ..errors import Cancelled, DataError, KarfError, OutOfMemory
from ..io.options import Options, option
from ..project import STAGE_ORDER, Project
from ..version import __version__
from .inbox import Inbox
from .path_map import PathMap
from .protocol import LOG_FILE, PROTOCOL, WARM, EventWriter, Query, Request
from .reporting import as_karf_error, print_error

if TYPE_CHECKING:
    from .queries.session import Session

SAME_PATHS = PathMap()


@dataclass(frozen=True, kw_only=True)
class WarmOptions(Options):
    """Answer queries about projects until none arrives for a while."""

    command: ClassVar[str] = WARM

    idle_minutes: int = option("how long to wait for the next query", 10, minimum=0, maximum=1440)


def run_request(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Run a request's command in this process; see `commands.dispatch.run_command`.

    Raises:
        KarfError: As the command does; BadRequest where an option is unknown, of another type or out of range.
    """
    run_command(options_of_job(request.stage, request.project, request.options), emit, should_stop)


class Worker:
    """A process that serves job folders.

    Args:
        paths: Folders that the caller knows by other paths; requests, queries and events have the caller's paths.
        wait_seconds: How long to wait for the next job after a finished one; 0 serves a single job.
        run: Runs a request.
    """

    def __init__(
        self,
        paths: PathMap = SAME_PATHS,
        wait_seconds: float = 0,
        run: Callable[[Request, Emit, Callable[[], bool]], None] = run_request,
    ) -> None:
        self._paths, self._wait_seconds, self._run = paths, wait_seconds, run
        self._events: EventWriter | None = None  # of the current job
        self._inbox = Inbox(self._emit)

    def serve(self, job: Path, lines: Iterable[str]) -> int:
        """Serve a job, and those that follow it.

        Args:
            job: The first job's folder, with its request.
            lines: Standard input: cancel, next jobs and queries.

        Returns:
            The last job's exit code.

        Raises:
            DataError: The folder does not exist.
        """
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
        """Serve one job and return its exit code."""
        if not job.is_dir():
            raise DataError(f"{job} is not a job folder.", "Give the folder that holds request.json.")
        self._events = EventWriter(job)
        try:
            self._emit("hello", protocol=PROTOCOL, engine=__version__, python=platform.python_version(),
                       torch=_version("torch"), pid=os.getpid())  # fmt: skip
            request = self._request(job)
            if request.stage == WARM:
                self._answer_queries(job, request)
            else:
                self._run(request, self._emit, self._inbox.is_cancelled)
            self._emit("done", summary=_summary(request))
        except Exception as raised:
            error = as_karf_error(raised)
            self._emit_end(error)
            return error.exit_code
        finally:
            self._events = None
        return 0

    def _request(self, job: Path) -> Request:
        """Read the job's request and map its paths."""
        request = Request.read(job)
        return Request(
            request.stage, Path(self._paths.to_local(str(request.project))), self._paths.to_local(request.options)
        )

    def _answer_queries(self, job: Path, request: Request) -> None:
        """Answer queries until none arrives for a while, the caller cancels, or a job is waiting."""
        options = WarmOptions.from_json(request.options)
        from .queries.session import Session

        session = Session(job, options.threads, options.device)
        seconds = 60 * options.idle_minutes
        while (query := self._inbox.next_query(seconds)) is not None:
            self._answer(session, query)

    def _answer(self, session: Session, query: Query) -> None:
        """Answer a query with one event."""
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
    """Return the version of an installed package without importing it, or None."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _summary(request: Request) -> dict:
    """Return the summaries of the project's finished stages."""
    project = Project(request.project)
    if not project.state_file.exists():  # some commands have no project
        return {}
    return {stage: facts for stage in STAGE_ORDER if (facts := project.finished(stage))}
