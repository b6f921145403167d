"""Runs tasks (one engine job, or several in a row): beside the user interface, or blocking in a script.

Beside the interface one persistent timer polls the running task; a modal operator would hold back auto-save for as long
as it runs. In background mode timers never fire, so there a task blocks, prints its progress and raises its error.
One task runs at a time: the engine uses all the cores it is given.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from . import compat, engine_api, jobs, pictures, preferences
from .engine_api import BadRequest, Event, KarfError, Project, Request

POLL_SECONDS = 0.2
AREAS = ("VIEW_3D", "IMAGE_EDITOR")


@dataclass(frozen=True)
class Task:
    """Jobs of one project to run in a row, with what Blender does after each is done."""

    title: str
    requests: tuple[Request, ...]
    after: Callable[[Request], None]


class _Running:
    """A task at work: the job it is at, and the reports of those done."""

    def __init__(self, task: Task, python: Path, threads: int) -> None:
        self.task = task
        self.summaries: list[dict[str, Any]] = []
        self._python = python
        self._threads = threads
        self.job = self._start()

    def _start(self) -> jobs.Job:
        request = self.task.requests[len(self.summaries)]
        folder = Project(request.project).new_job(request.stage)
        return jobs.start(self._python, engine_api.ENGINE_FOLDER, request, folder, self._threads)

    def step(self) -> tuple[list[Event], bool]:
        """New events, and whether the whole task is done. Raises KarfError where a job failed."""
        events = self.job.poll()
        if not self.job.ended:
            return events, False
        self.summaries.append(self.job.summary())
        self.task.after(self.job.request)
        if len(self.summaries) == len(self.task.requests):
            return events, True
        self.job = self._start()
        return events, False


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
    bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)


def wait(task: Task) -> list[dict[str, Any]]:
    """Run a task and block until it is done, printing its progress; returns each job's summary. Raises KarfError."""
    running = _begin(task)
    try:
        while True:
            events, done = running.step()
            for event in events:
                _note(event)
                line = _line(event)
                if line:
                    print(f"KaRF {running.job.request.stage}: {line}", flush=True)
            if done:
                break
            time.sleep(POLL_SECONDS / 2)
    except KarfError as error:
        _finish(error)
        raise
    finally:
        # also where the user interrupts with Ctrl-C
        _end()
    return running.summaries


def cancel() -> None:
    """Ask the running task to stop. Raises BadRequest where none runs."""
    if not _running:
        raise BadRequest("No KaRF job is running.", "")
    _running[0].job.cancel()
    _progress().text = "Stopping"


def _begin(task: Task) -> _Running:
    if _running:
        raise BadRequest(f"KaRF is busy: {_running[0].task.title}.", "Wait for it, or cancel it.")
    running = _Running(task, preferences.engine_python(), preferences.current().threads)
    _running.append(running)
    progress = _progress()
    progress.running = True
    progress.stage = task.title
    progress.fraction = 0.0
    progress.text = "Starting"
    progress.error = progress.hint = ""
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
    progress.text = "" if error else "Done"
    progress.error = error.sentence if error else ""
    progress.hint = error.hint if error else ""


def _tick() -> float | None:
    """The timer: a step of the running task."""
    error, done = None, not _running
    try:
        if _running:
            events, done = _running[0].step()
            for event in events:
                _note(event)
            if not events and not done:
                return POLL_SECONDS
    except KarfError as failure:
        error, done = failure, True
    if done:
        _finish(error)
        _end()
    _redraw()
    return None if done else POLL_SECONDS


def _progress() -> bpy.types.PropertyGroup:
    return bpy.data.window_managers[0].karf_progress


def _note(event: Event) -> None:
    """Show an event in the panel."""
    progress = _progress()
    if event.kind == "progress":
        progress.fraction = event["step"] / max(event["total"], 1)
        progress.text = _line(event)
    elif event.kind in ("stage", "warning"):
        progress.text = _line(event)
    elif event.kind == "preview":
        pictures.show_preview(Path(event["path"]))


def _line(event: Event) -> str:
    """What a person reads of an event; empty for those that say nothing to one."""
    if event.kind == "progress":
        figures = "".join(f", {name} {value:.4g}" for name, value in (event.get("metrics") or {}).items())
        left = event.get("eta_s")
        time_left = f", {left / 60:.0f} min left" if left and left > 90 else f", {left:.0f} s left" if left else ""
        return f"{event['step']}/{event['total']}{time_left}{figures}"
    if event.kind == "hello":
        return f"engine {event.get('engine')}, torch {event.get('torch')} on {event.get('device')}"
    return {"stage": event.get("name"), "warning": event.get("sentence"), "done": "done"}.get(event.kind) or ""


def _redraw() -> None:
    for window in bpy.data.window_managers[0].windows:
        for area in window.screen.areas:
            if area.type in AREAS:
                area.tag_redraw()


def _before_exit(*_):
    _end()


def register():
    if compat.exit_handlers() is not None:
        compat.exit_handlers().append(_before_exit)


def unregister():
    if compat.exit_handlers() is not None:
        compat.exit_handlers().remove(_before_exit)
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    _end()
