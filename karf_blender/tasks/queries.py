"""Queries to a separate worker: started on demand, polled by a timer, ended when idle; in background mode they block.

The worker answers beside a running task: it only reads, and reads again what a task has learned.
"""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import bpy

from .. import preferences, progress, session
from ..engine.failures import disk_error
from ..engine.worker import Worker, error_from_event
from ..engine_api import WARM, Event, KarfError, Request
from ..host import rendering, windows
from ..project import folders
from .runner import Owner, begin_job

POLL_SECONDS = 0.02

OnAnswer = Callable[[bpy.types.Scene, dict[str, Any]], None]
OnError = Callable[[KarfError], None]


@dataclass(frozen=True)
class _Query:
    owner: Owner
    kind: str
    options: dict
    on_answer: OnAnswer
    on_error: OnError
    is_second: bool = False  # whether another worker ended before it answered


class WarmWorker:
    """Keeps a worker for queries; the session has one for the interface and one for the render thread."""

    idle_minutes: int | None = None  # after which it ends; None: as the engine chooses

    def __init__(self) -> None:
        self.worker: Worker | None = None

    def start(self, scene: bpy.types.Scene) -> Worker:
        """Return a worker that suits the preferences; start one if needed, or raise KarfError."""
        python, threads = preferences.engine_python(), preferences.current().threads
        if self.worker is not None and not self.worker.suits(python, threads):
            self.close()
        if self.worker is None:
            options = {"threads": threads, "idle_minutes": self.idle_minutes}
            given = {name: value for name, value in options.items() if value}
            worker = Worker()
            begin_job(worker, Request(WARM, folders.project_of(scene).folder, given))
            self.worker = worker
        return self.worker

    def leave(self) -> None:
        """Drop a worker that has ended. If it failed, raise its KarfError and keep its folder for the log."""
        try:
            self.worker.check()
        except KarfError:
            self.worker = None
            raise
        self.close()

    def close(self) -> None:
        """End the worker and delete its folder."""
        if self.worker is not None:
            self.worker.end()
            shutil.rmtree(self.worker.folder, ignore_errors=True)
            self.worker = None


class QueryWorker(WarmWorker):
    """The worker of the interface's queries."""


def send(
    scene: bpy.types.Scene, kind: str, options: dict[str, Any], on_answer: OnAnswer, on_error: OnError | None = None
) -> None:
    """Send a query of one of the engine's `queries.QUERIES` and return; in background mode, block until the answer.

    A later query replaces one of its kind that has not begun. `options` are JSON values with absolute paths; `on_answer`
    deletes the answer's files, and is not called if the scene is gone or has another project. By default, the panel
    shows errors. Raises KarfError if the worker cannot be started; in background mode also if the query failed.
    """
    _begin(scene, kind, options, on_answer, on_error or _fail)
    if bpy.app.background:
        _wait(kind)
    else:
        session.start_timer(_poll, persistent=True)


def wait(scene: bpy.types.Scene, kind: str, options: dict[str, Any]) -> dict[str, Any]:
    """Send a query as `send`, block until it is answered, and return the answer's values or raise its KarfError."""
    answers: list[dict[str, Any]] = []
    errors: list[KarfError] = []
    _begin(scene, kind, options, lambda _, values: answers.append(values), errors.append)
    _wait(kind)
    for error in errors:
        raise error
    (answer,) = answers
    return answer


def is_waiting(kind: str) -> bool:
    """Return True while a query of this kind is unanswered."""
    worker = session.get(QueryWorker).worker
    return worker is not None and any(query.kind == kind for query in worker.unanswered.values())


def stop() -> None:
    """End the worker and delete its folder; unanswered queries are dropped."""
    session.get(QueryWorker).close()


def _begin(scene: bpy.types.Scene, kind: str, options: dict, on_answer: OnAnswer, on_error: OnError) -> None:
    options = {"project": str(folders.project_of(scene).folder), **options}
    _take_replies()  # the worker may have ended since the last query
    _send(scene, _Query(Owner.of(scene), kind, options, on_answer, on_error))


def _send(scene: bpy.types.Scene, query: _Query) -> None:
    session.get(QueryWorker).start(scene).query(query.kind, query.options, query)


def _wait(kind: str) -> None:
    while is_waiting(kind):
        time.sleep(POLL_SECONDS / 2)
        _take_replies()


def _take_replies() -> None:
    kept = session.get(QueryWorker)
    worker = kept.worker
    if worker is None:
        return
    for query, event in worker.replies():
        _hand_out(query, event)
    if worker.ended and worker is kept.worker:
        _leave(worker)


def _hand_out(query: _Query, event: Event) -> None:
    scene = query.owner.find()
    if event.kind == "dropped" or scene is None:
        return
    try:
        if event.kind == "refused":
            raise error_from_event(event)
        query.on_answer(scene, {name: value for name, value in event.values.items() if name != "id"})
    except KarfError as error:
        query.on_error(error)
    except OSError as error:  # what follows writes masks: were it raised, nobody would hear of other answers any more
        query.on_error(disk_error(error))


def _leave(worker: Worker) -> None:
    """Report to all waiting callers that the worker has ended, or ask a new one."""
    failure = None
    try:
        session.get(QueryWorker).leave()
    except KarfError as error:
        failure = error
    for query in list(worker.unanswered.values()):
        if failure is not None or query.is_second:
            query.on_error(failure or KarfError("The engine exited before it answered.", "Try again."))
        elif (scene := query.owner.find()) is not None:  # the worker ended because it was idle
            _send(scene, replace(query, is_second=True))


def _fail(error: KarfError) -> None:
    if bpy.app.background:
        raise error
    progress.fail(error)
    windows.redraw()


def _poll() -> float | None:
    if rendering.is_over():  # what follows an answer touches pixels and data
        _take_replies()
    worker = session.get(QueryWorker).worker
    return POLL_SECONDS if worker is not None and worker.unanswered else None
