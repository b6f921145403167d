"""Tasks: engine jobs in a row, run alongside the user interface or blocking in a script.

In background mode a task blocks, prints its progress and raises its error. One task runs at a time: the engine uses all
the cores it is given. Its worker is kept for a moment, for the next job.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from .. import engine_api, preferences, progress, session
from ..engine.failures import disk_errors, log_tail
from ..engine.worker import Worker
from ..engine_api import BadRequest, Cancelled, Event, KarfError, Project, Request, new_job
from ..host import rendering, windows
from ..pictures import editors
from ..project import disk, folders
from .course import Course
from .ownership import Owner

POLL_SECONDS = 0.2
PRINT_SECONDS = 5.0
KEEP_SECONDS = 60.0  # that the worker waits for the next job; half of it counts on it
STATUS_CHANGED, JOB_DONE = "status_changed", "job_done"  # events: of the running task; with its request and seconds
REPORTED = ("internal", "dependency")  # codes of errors that the log explains


@dataclass(frozen=True)
class Task:
    """Jobs of one project to run in a row, and what Blender does after each of them."""

    title: str
    requests: tuple[Request, ...]  # none: all is done already
    after: Callable[[Request], None]  # called with each job's request when it is done
    owner: Owner | None = None  # who began it
    seconds: tuple[float, ...] = ()  # that each job is expected to take, where they are several
    result: Callable[[], Any] = lambda: None  # what `wait` returns

    def wait(self) -> Any:
        """Run the jobs, printing their progress, and block until all is done.

        Returns:
            The result.

        Raises:
            KarfError: A job cannot start, or it fails.
        """
        if self.requests:
            wait(self)
        return self.result()

    @property
    def is_file_open(self) -> bool:
        """True while the file is open that began the task."""
        return self.owner is None or self.owner.is_file_open

    @property
    def label(self) -> str:
        """The title, with the scene's name where the file has several, or that it is another file's."""
        if not self.is_file_open:
            return f"{self.title} (of another file)"
        scene = self.owner.find() if self.owner and len(bpy.data.scenes) > 1 else None
        return f"{self.title} ({scene.name})" if scene else self.title


class _Running:
    """A task at work: how many of its jobs are done, and whether it was asked to stop."""

    is_stopping = False

    def __init__(self, task: Task, python: Path, threads: int) -> None:
        self.task = task
        self._done = 0
        self._python = python
        self._threads = threads
        self.course = Course(task.seconds, time.monotonic()) if len(task.seconds) > 1 else None
        self._begin_next()

    def _begin_next(self) -> None:
        request = self.task.requests[self._done]
        self._began = time.monotonic()
        with disk_errors():
            folder = new_job(Project(request.project), request.stage)
        _jobs().worker.begin(self._python, request, folder, self._threads)

    def advance(self) -> bool:
        """Let Blender do what follows an ended job, and begin the next.

        Returns:
            True when the last is done.

        Raises:
            KarfError: The job failed, or what follows it.
        """
        if not _jobs().worker.ended:
            return False
        _jobs().worker.check()
        session.notify(JOB_DONE, _jobs().worker.request, time.monotonic() - self._began)
        with disk_errors():
            self.task.after(_jobs().worker.request)
        self._done += 1
        if self._done == len(self.task.requests):
            return True
        if self.course is not None:
            self.course.begin_next(time.monotonic())
        self._begin_next()
        return False


@dataclass
class _Jobs:
    """The task at work, if one is, and the worker that its jobs run in."""

    running: _Running | None = None
    worker: Worker = field(default_factory=lambda: Worker(KEEP_SECONDS))

    def close(self) -> None:
        """End both."""
        _end()
        self.worker.end()


def _jobs() -> _Jobs:
    return session.get(_Jobs)


def _redraw(is_whole: bool) -> None:
    """Draw the panels again, or the whole areas that have them."""
    if is_whole:
        windows.redraw(*windows.PANEL_AREAS)
    else:
        windows.redraw_sidebars()
    session.notify(STATUS_CHANGED)


def is_running() -> bool:
    """True while a task is at work."""
    return _jobs().running is not None


def current_request(scene: bpy.types.Scene) -> Request | None:
    """What the engine is doing for the scene's project; None where it does nothing for it."""
    if _jobs().running is None or not scene.karf.project:
        return None
    request = _jobs().worker.request
    return request if request.project == folders.project_of(scene).folder else None


def launch(task: Task) -> None:
    """Run a task alongside the interface and return at once; in background mode, block until it is done.

    Raises:
        KarfError: It cannot start; in background mode also: it fails.
    """
    if bpy.app.background:
        wait(task)
        return
    _begin(task)
    session.start_timer(_poll, persistent=True)


def wait(task: Task) -> None:
    """Run a task and block until it is done, printing its progress.

    Raises:
        KarfError: It cannot start, or it fails.
    """
    running = _begin(task)
    quiet_until = 0.0
    try:
        done = False
        while not done:
            stage = _jobs().worker.request.stage
            for event in _jobs().worker.poll():
                _show(running, event)
                if event.kind != "progress" or time.monotonic() > quiet_until:
                    quiet_until = time.monotonic() + PRINT_SECONDS
                    progress.print_event(stage, event)
            done = running.advance()
            time.sleep(POLL_SECONDS / 2)
        _finish(None)
    except KarfError as error:
        _finish(error)
        raise
    finally:
        # also where the user interrupts with Ctrl-C
        _end()


def cancel() -> None:
    """Ask the running task to stop.

    Raises:
        BadRequest: None runs.
    """
    if _jobs().running is None:
        raise BadRequest("No KaRF job is running.", "")
    _jobs().worker.cancel()
    _jobs().running.is_stopping = True
    progress.state().text = "Stopping"


def release() -> None:
    """End the worker where it only waits for a next job: its Python may be replaced."""
    if _jobs().running is None:
        _jobs().worker.end()


def _begin(task: Task) -> _Running:
    if _jobs().running is not None:
        raise BadRequest("KaRF is busy: {title}.", "Wait for it, or cancel it.", title=_jobs().running.task.title)
    running = _Running(task, preferences.engine_python(), preferences.current().threads)
    _jobs().running = running
    progress.begin(task.label)
    return running


def _end() -> None:
    """Forget the running task; its job is ended where it is still at work."""
    jobs = _jobs()
    if jobs.running is not None:
        jobs.running = None
        if not jobs.worker.ended:
            jobs.worker.end()
        progress.state().running = False
        disk.refresh()


def _finish(error: KarfError | None) -> None:
    state = progress.state()
    if isinstance(error, Cancelled):
        state.text = "cancelled"
    elif error is not None:
        progress.fail(error)
        if error.code in REPORTED:
            state.job = str(_jobs().worker.folder)
            print(
                f"The end of {_jobs().worker.folder / engine_api.LOG_FILE}:\n{log_tail(_jobs().worker.folder)}",
                flush=True,
            )
    else:
        state.text = "done"


def _poll() -> float | None:
    """Called by the timer as long as a task runs: shows what it has reported."""
    if _jobs().running is None:
        return None
    running = _jobs().running
    try:
        events = _jobs().worker.poll()
        for event in events:
            if not running.is_stopping:
                _show(running, event)
        # what follows a job touches pixels and data
        done = rendering.is_over() and running.advance()
    except Exception as failure:
        is_ours = isinstance(failure, KarfError)
        _finish(
            failure
            if is_ours
            else KarfError("Internal error: {error!r}.", "See the console for details.", error=failure)
        )
        _end()
        _redraw(is_whole=True)
        if not is_ours:
            raise
        return None
    if done:
        _finish(None)
        _end()
        # what the task brought into the scene is a step of its own to undo
        if running.task.is_file_open and bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=running.task.title)
    if events or done:
        _redraw(is_whole=done)
    return None if done else POLL_SECONDS


def _show(running: _Running, event: Event) -> None:
    """Show an event in the panel, a preview in an Image Editor."""
    course, task = running.course, running.task
    if course is not None and event.kind == "progress":
        course.take(event, _jobs().worker.request.stage, time.monotonic())
    progress.show_event(task.label, event, course and (course.share(), course.left()))
    if event.kind == "preview" and task.is_file_open and not rendering.is_running():
        editors.show_preview(Path(event["path"]))


@session.handler("load_post", phase=session.Phase.STATE)
def _after_load(*_):
    # a file saved during a job remembers its progress; the job is not in the file
    progress.state().running = is_running()
    progress.dismiss()
