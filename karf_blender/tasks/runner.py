"""Tasks: engine jobs in a row, run alongside the user interface or blocking in a script.

In background mode a task blocks, prints its progress and raises its error. Only one task runs at a time, as the engine
uses all its cores. Its worker waits for a while for the next job.
"""

import time
from collections.abc import Callable, Iterator
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
from .overall_progress import OverallProgress

POLL_SECONDS = 0.2
PRINT_SECONDS = 5.0
KEEP_SECONDS = 60.0  # that the worker waits for the next job; half of it counts on it
STATUS_CHANGED, JOB_DONE = "status_changed", "job_done"  # events: of the running task; with its request and seconds
REPORTED = ("internal", "dependency")  # codes of errors that the log explains


class OpenFile:
    """The open file; a new object for each opened file, also if it is the same again."""

    per_file = True


@dataclass(frozen=True)
class Owner:
    """A scene of a file and its project folder, if any."""

    file: OpenFile
    scene: int
    project: Path | None

    @classmethod
    def of(cls, scene: bpy.types.Scene) -> "Owner":
        return cls(session.get(OpenFile), scene.session_uid, _project_of(scene))

    @property
    def is_file_open(self) -> bool:
        """Return True while no other file was opened."""
        return self.file is session.get(OpenFile)

    def find(self) -> bpy.types.Scene | None:
        """Return the scene, if it still exists and has the same project."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if scene.session_uid == self.scene and _project_of(scene) == self.project:
                return scene
        return None

    def scenes(self) -> Iterator[bpy.types.Scene]:
        """Yield all scenes of the file with the same project; none after another file was opened."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if self.project is not None and _project_of(scene) == self.project:
                yield scene


def _project_of(scene: bpy.types.Scene) -> Path | None:
    return folders.project_of(scene).folder if scene.karf.project else None


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
        """Run the jobs as `runner.wait`, and return the result."""
        if self.requests:
            wait(self)
        return self.result()

    @property
    def is_file_open(self) -> bool:
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
        self.task, self.is_stopping = task, False
        self.overall = OverallProgress(task.seconds, time.monotonic()) if len(task.seconds) > 1 else None
        self._worker, self._n_done = worker, 0
        self._begin_next()

    def _begin_next(self) -> None:
        self._began = time.monotonic()
        begin_job(self._worker, self.task.requests[self._n_done])

    def advance(self) -> bool:
        """Do the work after an ended job, and begin the next; True when the last is done.

        Raises KarfError if the job failed, or what follows it.
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


def begin_job(worker: Worker, request: Request) -> None:
    """Begin a job in a new folder, with the Python and the threads of the preferences; raise KarfError if it cannot."""
    python, threads = preferences.engine_python(), preferences.current().threads
    with disk_errors():
        folder = new_job(Project(request.project), request.stage)
    worker.begin(python, request, folder, threads)


def launch(task: Task) -> None:
    """Run a task alongside the interface and return at once; in background mode, block until the end.

    Raises KarfError if it cannot start; in background mode also if it fails.
    """
    if bpy.app.background:
        wait(task)
        return
    _begin(task)
    session.start_timer(_poll, persistent=True)


def wait(task: Task) -> None:
    """Run a task, printing its progress, and block until the end; raise KarfError if it cannot start, or fails."""
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
    """Ask the running task to stop; raise BadRequest if none runs."""
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
        internal = KarfError("Internal error: {error!r}.", "See the console for details.", error=failure)
        _finish(failure if is_ours else internal)
        windows.redraw(*windows.PANEL_AREAS)
        session.notify(STATUS_CHANGED)
        if not is_ours:
            raise
        return None
    if done:
        _finish(None)
        # one undo step for all that the task brought into the scene
        if running.task.is_file_open and bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=running.task.title)
        windows.redraw(*windows.PANEL_AREAS)
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
