"""Runs tasks (one engine job, or several in a row): beside the user interface, or blocking in a script.

Beside the interface one persistent timer polls the running task; a modal operator would hold back auto-save for as long
as it runs. In background mode timers never fire, so there a task blocks, prints its progress and raises its error.
One task runs at a time: the engine uses all the cores it is given.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from . import compat, disk, engine_api, jobs, pictures, preferences, rendering, windows
from .engine_api import BadRequest, Cancelled, Event, KarfError, Project, Request
from .ownership import Owner

POLL_SECONDS = 0.2
PRINT_SECONDS = 5.0
REPORTED = ("internal", "dependency")  # codes of errors that the log tells more of


@dataclass(frozen=True)
class Task:
    """Jobs of one project to run in a row, with what Blender does after each is done, for the scene that began them."""

    title: str
    requests: tuple[Request, ...]
    after: Callable[[Request], None]
    owner: Owner | None = None

    @property
    def is_at_home(self) -> bool:
        """True while the file is open that began the task."""
        return self.owner is None or self.owner.is_open

    @property
    def label(self) -> str:
        """The title, with the scene's name where the file has several, or that it is another file's."""
        if not self.is_at_home:
            return f"{self.title} (of another file)"
        scene = self.owner.find() if self.owner and len(bpy.data.scenes) > 1 else None
        return f"{self.title} ({scene.name})" if scene else self.title


class _Running:
    """A task at work: the job it is at, how many are done, and whether it was asked to stop."""

    is_stopping = False

    def __init__(self, task: Task, python: Path, threads: int) -> None:
        self.task = task
        self._done = 0
        self._python = python
        self._threads = threads
        self.job = self._start()

    def _start(self) -> jobs.Job:
        request = self.task.requests[self._done]
        with jobs.disk_errors():
            folder = Project(request.project).new_job(request.stage)
        return jobs.start(self._python, engine_api.ENGINE_FOLDER, request, folder, self._threads)

    def advance(self) -> bool:
        """Take an ended job over and start the next; True when the last is done. Raises KarfError where it failed."""
        if not self.job.ended:
            return False
        self.job.check()
        with jobs.disk_errors():
            self.task.after(self.job.request)
        self._done += 1
        if self._done == len(self.task.requests):
            return True
        self.job = self._start()
        return False


_running: list[_Running] = []


def is_running() -> bool:
    """True while a task is at work."""
    return bool(_running)


def launch(task: Task) -> None:
    """Run a task beside the interface and return at once; in background mode, block until it is done.

    Raises KarfError where it cannot start, in background mode also where it fails.
    """
    if bpy.app.background:
        wait(task)
        return
    _begin(task)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)


def wait(task: Task) -> None:
    """Run a task and block until it is done, printing its progress. Raises KarfError."""
    running = _begin(task)
    quiet_until = 0.0
    try:
        done = False
        while not done:
            stage = running.job.request.stage
            for event in running.job.poll():
                _note(task, event)
                if event.kind != "progress" or time.monotonic() > quiet_until:
                    quiet_until = time.monotonic() + PRINT_SECONDS
                    _print(stage, event)
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
    """Ask the running task to stop. Raises BadRequest where none runs."""
    if not _running:
        raise BadRequest("No KaRF job is running.", "")
    _running[0].job.cancel()
    _running[0].is_stopping = True
    _progress().text = "Stopping"


def warn(sentence: str) -> None:
    """Tell of what a user should know, in the panel and on the console."""
    print(f"KaRF: {sentence}", flush=True)
    _add_warning(sentence)


def _add_warning(sentence: str) -> None:
    progress = _progress()
    if sentence not in progress.warnings.splitlines():
        progress.warnings = f"{progress.warnings}\n{sentence}".strip()


def dismiss() -> None:
    """Clear what the panel says of the last task."""
    progress = _progress()
    progress.text = progress.figures = progress.warnings = progress.error = progress.hint = progress.job = ""


def _begin(task: Task) -> _Running:
    if _running:
        raise BadRequest(f"KaRF is busy: {_running[0].task.title}.", "Wait for it, or cancel it.")
    running = _Running(task, preferences.engine_python(), preferences.current().threads)
    _running.append(running)
    progress = _progress()
    progress.running = True
    progress.stage = task.label
    progress.fraction = 0.0
    dismiss()
    progress.text = "Starting"
    return running


def _end() -> None:
    """Forget the running task; its child is ended where it still lives."""
    while _running:
        running = _running.pop()
        if not running.job.ended:
            running.job.terminate()
        _progress().running = False


def _finish(error: KarfError | None) -> None:
    progress = _progress()
    if isinstance(error, Cancelled):
        progress.text = "cancelled"
    elif error is not None:
        progress.text, progress.error, progress.hint = "", error.sentence, error.hint
        if error.code in REPORTED:
            job = _running[0].job
            progress.job = str(job.folder)
            print(f"The end of {job.folder / engine_api.LOG_FILE}:\n{job.log_tail()}", flush=True)
    else:
        progress.text = "done"
    disk.look()


def _tick() -> float | None:
    """The timer: takes in what the running task has reported, and stops itself when there is none."""
    if not _running:
        return None
    running = _running[0]
    try:
        events = running.job.poll()
        for event in events:
            if not running.is_stopping:
                _note(running.task, event)
        # what follows a job touches pixels and data
        done = rendering.is_over() and running.advance()
    except Exception as failure:
        is_ours = isinstance(failure, KarfError)
        _finish(failure if is_ours else KarfError(f"Internal error: {failure!r}.", "The console shows where."))
        _end()
        windows.redraw(*windows.PANEL_AREAS)
        if not is_ours:
            raise
        return None
    if done:
        _finish(None)
        _end()
        # what the task brought into the scene is a step of its own to undo
        if running.task.is_at_home and bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=running.task.title)
    if events or done:
        windows.redraw(*windows.PANEL_AREAS)
    return None if done else POLL_SECONDS


def _progress() -> bpy.types.PropertyGroup:
    return bpy.data.window_managers[0].karf_progress


def _note(task: Task, event: Event) -> None:
    """Show an event in the panel."""
    progress = _progress()
    progress.running, progress.stage = True, task.label
    if event.kind == "progress":
        progress.fraction = event["step"] / max(event["total"], 1)
        progress.text = f"{progress.fraction:.0%}{_time_left(event)}"
        progress.figures = f"{event['stage']} {event['step']}/{event['total']}{_figures(event)}"
    elif event.kind == "stage":
        progress.figures = _line(event)
    elif event.kind == "warning":
        _add_warning(event["sentence"])
    elif event.kind == "preview" and task.is_at_home and not rendering.is_running():
        pictures.show_preview(Path(event["path"]))


def _line(event: Event) -> str:
    """What a person reads of an event; empty for those that say nothing to one."""
    if event.kind == "progress":
        return f"{event['step']}/{event['total']}{_time_left(event)}{_figures(event)}"
    if event.kind == "stage":
        return f"{event['name']} {event.get('text', '')}".strip()
    return {"warning": event.get("sentence"), "done": "done"}.get(event.kind) or ""


def _time_left(event: Event) -> str:
    left = event.get("eta_s")
    if not left:
        return ""
    return f", {left / 60:.0f} min left" if left > 90 else f", {left:.0f} s left"


def _figures(event: Event) -> str:
    return "".join(f", {name} {value:.4g}" for name, value in (event.get("metrics") or {}).items())


def _print(stage: str, event: Event) -> None:
    line = _line(event)
    if line:
        print(f"KaRF {stage}: {line}", flush=True)


@persistent
def _before_exit(*_):
    _end()


@persistent
def _after_load(*_):
    # a file saved during a job remembers its progress; the job is not in the file
    _progress().running = is_running()
    dismiss()


def register():
    """Called when the extension is enabled."""
    bpy.app.handlers.load_post.append(_after_load)
    if compat.exit_handlers() is not None:
        compat.exit_handlers().append(_before_exit)


def unregister():
    """Called when the extension is disabled."""
    if compat.exit_handlers() is not None:
        compat.exit_handlers().remove(_before_exit)
    bpy.app.handlers.load_post.remove(_after_load)
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _end()
