"""The worker that stills are asked of: from the render thread, which waits for each picture and hears of a cancel.

It is another one than that of the interface's queries, which the timer polls on the main thread meanwhile. It is kept
for the next frame of an animation, and ends when none comes for a while.
"""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy

from .. import preferences, session
from ..engine.failures import disk_errors
from ..engine.worker import Worker, error_from_event
from ..engine_api import WARM, Cancelled, KarfError, Request, new_job
from ..project import folders

POLL_SECONDS = 0.005
IDLE_MINUTES = 1


@dataclass
class _State:
    """The worker, if one waits."""

    worker: Worker | None = None

    def close(self) -> None:
        """End the worker, whose folder goes with it."""
        if self.worker is not None:
            self.worker.end()
            shutil.rmtree(self.worker.folder, ignore_errors=True)
            self.worker = None


def ask(scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict[str, Any]:
    """Send a query, and wait for its answer.

    Args:
        scene: One with a project, which the option `project` names if it is not given.
        kind: One of the engine's `queries.QUERIES`.
        options: JSON values, paths absolute.
        is_cancelled: Asked while waiting.

    Returns:
        The answer's values; files that these name are the caller's to delete.

    Raises:
        Cancelled: It was cancelled, which ends the worker: what it is at would take on.
        KarfError: There is no answer.
    """
    options = {"project": str(folders.project_of(scene).folder), **options}
    for _ in range(2):  # the worker may end for want of queries just when one comes
        answer = _answer(_worker(scene), kind, options, is_cancelled)
        if answer is not None:
            return answer
    raise KarfError("The engine exited before it answered.", "Try again.")


def _answer(worker: Worker, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict | None:
    """The answer's values; None where the worker has ended in peace before."""
    worker.query(kind, options, kind)
    while True:
        for _, event in worker.replies():
            if event.kind == "answer":
                return {name: value for name, value in event.values.items() if name != "id"}
            if event.kind == "refused":
                raise error_from_event(event)
        if worker.ended:
            _leave(worker)
            return None
        if is_cancelled():
            stop()
            raise Cancelled("The render was cancelled.")
        time.sleep(POLL_SECONDS)


def stop() -> None:
    """End the worker, whose folder goes with it."""
    session.get(_State).close()


def _worker(scene: bpy.types.Scene) -> Worker:
    python, threads = preferences.engine_python(), preferences.current().threads
    worker = session.get(_State).worker
    if worker is not None and (not worker.suits(python, threads) or _has_ended(worker)):
        stop()
    if session.get(_State).worker is None:
        project = folders.project_of(scene)
        with disk_errors():
            folder = new_job(project, WARM)
        options = {"idle_minutes": IDLE_MINUTES} | ({"threads": threads} if threads else {})
        worker = Worker()
        worker.begin(python, Request(WARM, project.folder, options), folder, threads)
        session.get(_State).worker = worker
    return session.get(_State).worker


def _has_ended(worker: Worker) -> bool:
    worker.poll()
    return worker.ended


def _leave(worker: Worker) -> None:
    """Take leave of a worker that has ended; the folder of one that failed is kept for its log, which the error names."""
    try:
        worker.check()
    except KarfError:
        session.get(_State).worker = None
        raise
    stop()
