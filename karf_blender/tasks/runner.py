"""Tasks: engine jobs in a row, run alongside the user interface or blocking in a script.

In background mode a task blocks, prints its progress and raises its error. Only one task runs at a time, as the engine
uses all its cores. Its worker waits for a while for the next job.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from .. import engine_api, progress, session
from ..engine.failures import disk_errors, log_tail
from ..engine.worker import Worker
from ..engine_api import BadRequest, Cancelled, Event, KarfError, Request
from ..host import rendering, windows
from ..pictures import editors
from ..project import disk, folders
from .overall_progress import OverallProgress
from .ownership import Owner
from .workers import begin_job

POLL_SECONDS = 0.2
PRINT_SECONDS = 5.0
KEEP_SECONDS = 60.0  # that the worker waits for the next job; half of it counts on it
STATUS_CHANGED, JOB_DONE = "status_changed", "job_done"  # events: of the running task; with its request and seconds
REPORTED = ("internal", "dependency")  # codes of errors that the log explains


@dataclass(frozen=True)
class Task:
    """Jobs of one project in a row, and the work in Blender after each."""

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
        """Return True while the task's file is open."""
        return self.owner is None or self.owner.is_file_open

    @property
    def label(self) -> str:
        """The title, with the scene's name if the file has several, or a note that it belongs to another file."""
        if not self.is_file_open:
            return f"{self.title} (of another file)"
        scene = self.owner.find() if self.owner and len(bpy.data.scenes) > 1 else None
        return f"{self.title} ({scene.name})" if scene else self.title


class RunningTask:
    """A running task and its progress."""

    def __init__(self, task: Task, worker: Worker) -> None:
        """Begin the first job."""
        self.task, self.is_stopping = task, False
        self.overall = OverallProgress(task.seconds, time.monotonic()) if len(task.seconds) > 1 else None
        self._worker, self._n_done = worker, 0
        self._begin_next()

    def _begin_next(self) -> None:
        self._began = time.monotonic()
        begin_job(self._worker, self.task.requests[self._n_done])

    def advance(self) -> bool:
        """Do the work after an ended job, and begin the next.

        Returns:
            True when the last is done.

        Raises:
            KarfError: The job failed, or what follows it.
        """
        if not self._worker.ended:
            return False
        self._worker.check()
        session.notify(JOB_DONE, self._worker.request, time.monotonic() - self._began)
        with disk_errors():
            self.task.after(self._worker.request)
        self._n_done += 1
        if self._n_done == len(self.task.requests):
            return True
        if self.overall is not None:
            self.overall.begin_next(time.monotonic())
        self._begin_next()
        return False


@dataclass
class Runner:
    """The running task, if any, and its worker."""

    running: RunningTask | None = None
    worker: Worker = field(default_factory=lambda: Worker(KEEP_SECONDS))

    def end_task(self) -> None:
        """Drop the running task, and end its job if it is still running."""
        if self.running is not None:
            self.running = None
            if not self.worker.ended:
                self.worker.end()
            progress.state().running = False
            disk.refresh()

    def close(self) -> None:
        """End the task and the worker."""
        self.end_task()
        self.worker.end()


def _worker() -> Worker:
    return session.get(Runner).worker


def _running() -> RunningTask | None:
    return session.get(Runner).running


def is_running() -> bool:
    """Return True while a task runs."""
    return _running() is not None


def current_request(scene: bpy.types.Scene) -> Request | None:
    """Return the engine's current request for the scene's project, if any."""
    if not is_running() or not scene.karf.project:
        return None
    request = _worker().request
    return request if request.project == folders.project_of(scene).folder else None


def launch(task: Task) -> None:
    """Run a task alongside the interface and return at once; in background mode, block until the end.

    Raises:
        KarfError: It cannot start; in background mode also: it fails.
    """
    if bpy.app.background:
        wait(task)
        return
    _begin(task)
    session.start_timer(_poll, persistent=True)


def wait(task: Task) -> None:
    """Run a task, printing its progress, and block until the end.

    Raises:
        KarfError: It cannot start, or it fails.
    """
    running = _begin(task)
    quiet_until = 0.0
    try:
        done = False
        while not done:
            stage = _worker().request.stage
            for event in _worker().poll():
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
        session.get(Runner).end_task()  # also where the user interrupts with Ctrl-C


def cancel() -> None:
    """Ask the running task to stop.

    Raises:
        BadRequest: None runs.
    """
    if not is_running():
        raise BadRequest("No KaRF job is running.", "")
    _worker().cancel()
    _running().is_stopping = True
    progress.state().text = "Stopping"


def release() -> None:
    """End an idle worker: its Python may be replaced."""
    if not is_running():
        _worker().end()


def _begin(task: Task) -> RunningTask:
    runner = session.get(Runner)
    if runner.running is not None:
        raise BadRequest("KaRF is busy: {title}.", "Wait for it, or cancel it.", title=runner.running.task.title)
    runner.running = RunningTask(task, runner.worker)
    progress.begin(task.label)
    return runner.running


def _finish(error: KarfError | None) -> None:
    """Report the end of the task."""
    state, folder = progress.state(), _worker().folder
    if isinstance(error, Cancelled):
        state.text = "cancelled"
    elif error is not None:
        progress.fail(error)
        if error.code in REPORTED:
            state.job = str(folder)
            print(f"The end of {folder / engine_api.LOG_FILE}:\n{log_tail(folder)}", flush=True)
    else:
        state.text = "done"
    session.get(Runner).end_task()


def _poll() -> float | None:
    """Show the events of the running task. A timer."""
    running = _running()
    if running is None:
        return None
    try:
        events = _worker().poll()
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
        windows.redraw()
        session.notify(STATUS_CHANGED)
        if not is_ours:
            raise
        return None
    if done:
        _finish(None)
        # one undo step for all that the task brought into the scene
        if running.task.is_file_open and bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=running.task.title)
        windows.redraw()
    elif events:
        windows.redraw_sidebars()
    if events or done:
        session.notify(STATUS_CHANGED)
    return None if done else POLL_SECONDS


def _show(running: RunningTask, event: Event) -> None:
    """Show an event in the panel, a preview in an Image Editor."""
    overall, task = running.overall, running.task
    if overall is not None and event.kind == "progress":
        overall.take(event, _worker().request.stage, time.monotonic())
    progress.show_event(task.label, event, overall and (overall.share(), overall.left()))
    if event.kind == "preview" and task.is_file_open and not rendering.is_running():
        editors.show_preview(Path(event["path"]))


@session.handler("load_post", phase=session.Phase.STATE)
def _after_load(*_):
    # a file saved during a job remembers its progress; the job is not in the file
    progress.state().running = is_running()
    progress.dismiss()
