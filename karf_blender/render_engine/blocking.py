"""Blocking queries from the render thread, which waits for each picture and can cancel it.

They use a separate worker, as the timer polls the interface's worker on the main thread meanwhile. It stays for
the next frame of an animation, and ends when none comes for a while.
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
    worker: Worker | None = None

    def close(self) -> None:
        """End the worker and remove its folder."""
        if self.worker is not None:
            self.worker.end()
            shutil.rmtree(self.worker.folder, ignore_errors=True)
            self.worker = None


def ask(scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict[str, Any]:
    """Send a query, one of the engine's `queries.QUERIES`, and wait for its answer.

    Args:
        scene: Its project is the default of the option `project`.
        kind: The query.
        options: JSON values, paths absolute.
        is_cancelled: Called while waiting.

    Returns:
        The answer's values; the caller deletes files that they name.

    Raises:
        Cancelled: `is_cancelled` returned True; the worker has ended, as it would finish the query.
        KarfError: The engine does not answer.
    """
    options = {"project": str(folders.project_of(scene).folder), **options}
    for _ in range(2):  # an idle worker may end just before the query
        answer = _answer(_worker(scene), kind, options, is_cancelled)
        if answer is not None:
            return answer
    raise KarfError("The engine ended before it answered.", "Try again.")


def stop() -> None:
    """End the worker and remove its folder."""
    session.get(_State).close()


def _answer(worker: Worker, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict | None:
    """Return the answer's values; None if the worker has ended without a failure before."""
    worker.query(kind, options, kind)
    while True:
        for _, event in worker.replies():
            if event.kind == "answer":
                return {name: value for name, value in event.values.items() if name != "id"}
            if event.kind == "refused":
                raise error_from_event(event)
        if worker.ended:
            try:
                worker.check()
            except KarfError:
                session.get(_State).worker = None  # its folder stays: the error names its log
                raise
            stop()
            return None
        if is_cancelled():
            stop()
            raise Cancelled("The render was cancelled.")
        time.sleep(POLL_SECONDS)


def _worker(scene: bpy.types.Scene) -> Worker:
    state = session.get(_State)
    python, threads = preferences.engine_python(), preferences.current().threads
    if state.worker is not None:
        state.worker.poll()
        if state.worker.ended or not state.worker.suits(python, threads):
            stop()
    if state.worker is None:
        project = folders.project_of(scene)
        with disk_errors():
            folder = new_job(project, WARM)
        options = {"idle_minutes": IDLE_MINUTES} | ({"threads": threads} if threads else {})
        worker = Worker()
        worker.begin(python, Request(WARM, project.folder, options), folder, threads)
        state.worker = worker
    return state.worker
