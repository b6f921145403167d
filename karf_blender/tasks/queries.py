"""Queries of a worker of their own: started on demand, polled by the timer, ended when idle or with the extension.

It answers beside a running task: it only reads, and loads again what a task has learned. Where it crashes, those who
wait are told, and the next query starts a fresh one. In background mode a query blocks.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import bpy

from .. import progress, session
from ..engine.failures import disk_error
from ..engine.worker import Worker, error_from_event
from ..engine_api import Event, KarfError
from ..host import rendering, windows
from ..project import folders
from .ownership import Owner
from .workers import WarmWorker

POLL_SECONDS = 0.02

OnAnswer = Callable[[bpy.types.Scene, dict[str, Any]], None]
OnError = Callable[[KarfError], None]


@dataclass(frozen=True)
class _Query:
    """A query on its way: who began it, what follows, and whether a fresh worker was already tried."""

    owner: Owner
    kind: str
    options: dict
    on_answer: OnAnswer
    on_error: OnError
    is_second: bool = False


class QueryWorker(WarmWorker):
    """The worker of the interface's queries."""


def _current() -> Worker | None:
    return session.get(QueryWorker).worker


def send(
    scene: bpy.types.Scene, kind: str, options: dict[str, Any], on_answer: OnAnswer, on_error: OnError | None = None
) -> None:
    """Send a query and return at once; in background mode, block until it is answered.

    A later query of the same kind takes the place of one that has not begun, of which nothing more is heard; so it is
    with an answer that comes when the scene is gone or has another project.

    Args:
        scene: One with a project, which the option `project` names if it is not given.
        kind: One of the engine's `queries.QUERIES`.
        options: JSON values, paths absolute.
        on_answer: Called with the scene and the answer's values; files that these name are the caller's to delete.
        on_error: Called with why there is no answer; by default the panel says it, and in background mode it is raised.

    Raises:
        KarfError: The worker cannot be started; in background mode also: there is no answer.
    """
    _begin(scene, kind, options, on_answer, on_error or _fail)
    if bpy.app.background:
        _wait(kind)
    else:
        session.start_timer(_poll, persistent=True)


def wait(scene: bpy.types.Scene, kind: str, options: dict[str, Any]) -> dict[str, Any]:
    """Send a query, block until it is answered, and return the answer's values; arguments as for `send`.

    Raises:
        KarfError: There is no answer.
    """
    answers: list[dict[str, Any]] = []
    errors: list[KarfError] = []
    _begin(scene, kind, options, lambda _, values: answers.append(values), errors.append)
    _wait(kind)
    for error in errors:
        raise error
    (answer,) = answers
    return answer


def is_waiting(kind: str) -> bool:
    """Whether a query of this kind has no answer yet."""
    worker = _current()
    return worker is not None and any(query.kind == kind for query in worker.unanswered.values())


def stop() -> None:
    """End the worker, whose folder goes with it; of what was asked nothing more is heard."""
    session.get(QueryWorker).close()


def _begin(scene: bpy.types.Scene, kind: str, options: dict, on_answer: OnAnswer, on_error: OnError) -> None:
    options = {"project": str(folders.project_of(scene).folder), **options}
    query = _Query(Owner.of(scene), kind, options, on_answer, on_error)
    _worker(scene).query(kind, options, query)


def _wait(kind: str) -> None:
    while is_waiting(kind):
        time.sleep(POLL_SECONDS / 2)
        _take_replies()


def _worker(scene: bpy.types.Scene) -> Worker:
    """The worker that answers, as the preferences want it; a fresh one where there is none."""
    _take_replies()  # it may have ended since somebody waited last
    return session.get(QueryWorker).start(scene)


def _take_replies() -> None:
    """Hand out what was answered, and take leave of a worker that has ended."""
    worker = _current()
    for query, event in worker.replies() if worker else ():
        _hand_out(query, event)
    if worker is not None and worker.ended and worker is _current():
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
    """Tell those who wait that the worker has ended."""
    failure = None
    try:
        session.get(QueryWorker).leave()
    except KarfError as error:
        failure = error
    for query in list(worker.unanswered.values()):
        if failure is None and not query.is_second:
            _send_again(query)
        else:
            query.on_error(failure or KarfError("The engine exited before it answered.", "Try again."))


def _send_again(query: _Query) -> None:
    """Send a query to a fresh worker: the other one had just ended for want of queries."""
    scene = query.owner.find()
    if scene is not None:
        _worker(scene).query(query.kind, query.options, replace(query, is_second=True))


def _fail(error: KarfError) -> None:
    """Nobody took care of an error."""
    if bpy.app.background:
        raise error
    progress.fail(error)
    windows.redraw(*windows.PANEL_AREAS)


def _poll() -> float | None:
    """Called by the timer as long as somebody waits for an answer."""
    if rendering.is_over():  # what follows an answer touches pixels and data
        _take_replies()
    worker = _current()
    return POLL_SECONDS if worker is not None and worker.unanswered else None
