"""Tasks: engine jobs in a row, one task at a time; in background mode it blocks, prints progress and raises errors."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
    file: OpenFile
    scene: int
    project: Path | None

    @classmethod
    def of(cls, scene: bpy.types.Scene) -> "Owner":
        return cls(session.get(OpenFile), scene.session_uid, _project_of(scene))

    @property
    def is_file_open(self) -> bool:
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
    title: str
    requests: tuple[Request, ...]  # none: all is done already
    after: Callable[[Request], None]  # called with each job's request when it is done
    owner: Owner  # who began it
    seconds: tuple[float, ...] = ()  # that each job is expected to take, where they are several
    result: Callable[[], Any] = lambda: None  # what `wait` returns

    def wait(self) -> Any:
        """Run the jobs as `runner.wait`, and return the result."""
        if self.requests:
            wait(self)
        return self.result()

    @property
    def label(self) -> str:
        """The title, with the scene's name if the file has several, or a note that it belongs to another file."""
        if not self.owner.is_file_open:
            return f"{self.title} (of another file)"
        scene = self.owner.find() if len(bpy.data.scenes) > 1 else None
        return f"{self.title} ({scene.name})" if scene else self.title


class Runner:
    """The running task, if any, and the worker of its jobs."""

    def __init__(self) -> None:
        self.task: Task | None = None
        self.n_begun = 0  # tasks of this session
        self.worker = Worker(KEEP_SECONDS)
        self.is_stopping = False
        self.overall: OverallProgress | None = None  # of a task of several jobs
        self._n_done, self._began = 0, 0.0  # the jobs that are done, and when the current one began

    def begin(self, task: Task) -> None:
        """Begin the first job of a task; raise KarfError if it cannot start or another task runs."""
        if self.task is not None:
            raise BadRequest("KaRF is busy: {title}.", "Wait for it, or cancel it.", title=self.task.title)
        self.is_stopping, self._n_done = False, 0
        self.overall = OverallProgress(task.seconds, time.monotonic()) if len(task.seconds) > 1 else None
        self._begin_job(task)
        self.task, self.n_begun = task, self.n_begun + 1
        progress.begin(task.label)

    def _begin_job(self, task: Task) -> None:
        self._began = time.monotonic()
        begin_job(self.worker, task.requests[self._n_done])

    def advance(self) -> bool:
        """Do the work after an ended job, and begin the next; True when the last is done.

        Raises KarfError if the job failed, or what follows it.
        """
        if not self.worker.ended:
            return False
        task = self.task
        self.worker.check()
        session.notify(JOB_DONE, self.worker.request, time.monotonic() - self._began)
        with disk_errors():
            task.after(self.worker.request)
        self._n_done += 1
        if self._n_done == len(task.requests):
            return True
        if self.overall is not None:
            self.overall.begin_next(time.monotonic())
        self._begin_job(task)
        return False

    def show(self, event: Event) -> None:
        """Show an event in the panel, a preview in an Image Editor."""
        if self.overall is not None and event.kind == "progress":
            self.overall.take(event, self.worker.request.stage, time.monotonic())
        progress.show_event(self.task.label, event, self.overall and (self.overall.share(), self.overall.left()))
        if event.kind == "preview" and self.task.owner.is_file_open and not rendering.is_running():
            editors.show_preview(Path(event["path"]))

    def finish(self, error: KarfError | None = None) -> None:
        """Report the end of the task, and drop it."""
        state, folder = progress.state(), self.worker.folder
        if isinstance(error, Cancelled):
            state.text = "cancelled"
        elif error is not None:
            progress.fail(error)
            if error.code in REPORTED:
                state.job = str(folder)
                print(f"The end of {folder / engine_api.LOG_FILE}:\n{log_tail(folder)}", flush=True)
        else:
            state.text = "done"
        self.end_task()

    def end_task(self) -> None:
        """Drop the running task, and end its job if it is still running."""
        if self.task is not None:
            self.task = None
            if not self.worker.ended:
                self.worker.end()
            progress.state().running = False
            disk.refresh()

    def close(self) -> None:
        self.end_task()
        self.worker.end()


def is_running() -> bool:
    return session.get(Runner).task is not None


def n_begun() -> int:
    """Return how many tasks this session has begun: what shows their results compares it."""
    return session.get(Runner).n_begun


def current_request(scene: bpy.types.Scene) -> Request | None:
    """Return the engine's current request for the scene's project, if any."""
    if not is_running() or not scene.karf.project:
        return None
    request = session.get(Runner).worker.request
    return request if request.project == folders.project_of(scene).folder else None


def begin_job(worker: Worker, request: Request) -> None:
    """Begin a job in a new folder, with the Python and the threads of the preferences; raise KarfError if it cannot."""
    python, threads = preferences.engine_python(), preferences.current().threads
    with disk_errors():
        folder = new_job(Project(request.project), request.stage)
    worker.begin(python, request, folder, threads)


def launch(task: Task) -> None:
    """Start a task, or run it to its end in background mode; raise KarfError if it cannot start, or fails there."""
    if bpy.app.background:
        wait(task)
        return
    session.get(Runner).begin(task)
    session.start_timer(_poll, persistent=True)


def wait(task: Task) -> None:
    """Run a task, printing its progress, and block until the end; raise KarfError if it cannot start, or fails."""
    runner = session.get(Runner)
    runner.begin(task)
    quiet_until = 0.0
    try:
        done = False
        while not done:
            stage = runner.worker.request.stage
            for event in runner.worker.poll():
                runner.show(event)
                if event.kind != "progress" or time.monotonic() > quiet_until:
                    quiet_until = time.monotonic() + PRINT_SECONDS
                    progress.print_event(stage, event)
            done = runner.advance()
            time.sleep(POLL_SECONDS / 2)
        runner.finish()
    except KarfError as error:
        runner.finish(error)
        raise
    finally:
        runner.end_task()  # also where the user interrupts with Ctrl-C


def cancel() -> None:
    """Ask the running task to stop; raise BadRequest if none runs."""
    if not is_running():
        raise BadRequest("No KaRF job is running.", "")
    runner = session.get(Runner)
    runner.worker.cancel()
    runner.is_stopping = True
    progress.state().text = "Stopping"


def release() -> None:
    """End an idle worker: its Python may be replaced."""
    if not is_running():
        session.get(Runner).worker.end()


def _poll() -> float | None:
    runner = session.get(Runner)
    task = runner.task
    if task is None:
        return None
    try:
        events = runner.worker.poll()
        for event in events:
            if not runner.is_stopping:
                runner.show(event)
        # what follows a job touches pixels and data
        done = rendering.is_over() and runner.advance()
    except Exception as failure:
        is_ours = isinstance(failure, KarfError)
        internal = KarfError("Internal error: {error!r}.", "See the console for details.", error=failure)
        runner.finish(failure if is_ours else internal)
        windows.redraw()
        session.notify(STATUS_CHANGED)
        if not is_ours:
            raise
        return None
    if done:
        runner.finish()
        # one undo step for all that the task brought into the scene
        if task.owner.is_file_open and bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=task.title)
        windows.redraw()
    elif events:
        windows.redraw_sidebars()
    if events or done:
        session.notify(STATUS_CHANGED)
    return None if done else POLL_SECONDS


@session.handler("load_post", phase=session.Phase.STATE)
def _after_load(*_):
    # a file saved during a job remembers its progress; the job is not in the file
    progress.state().running = is_running()
    progress.dismiss()
