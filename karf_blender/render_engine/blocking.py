"""The worker that stills are asked of: from the render thread, which waits for each picture and hears of a cancel.

It is another one than that of the interface's queries, which the timer polls on the main thread meanwhile. It is kept
for the next frame of an animation, and ends when none comes for a while.
"""

import time
from collections.abc import Callable
from typing import Any, ClassVar

import bpy

from .. import session
from ..engine.worker import Worker, error_from_event
from ..engine_api import Cancelled, KarfError
from ..project import folders
from ..tasks.warm_worker import WarmWorker

POLL_SECONDS = 0.005


class RenderWorker(WarmWorker):
    """The worker that stills are asked of."""

    options: ClassVar = {"idle_minutes": 1}


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
            session.get(RenderWorker).leave()
            return None
        if is_cancelled():
            stop()
            raise Cancelled("The render was cancelled.")
        time.sleep(POLL_SECONDS)


def stop() -> None:
    """End the worker, whose folder goes with it."""
    session.get(RenderWorker).close()


def _worker(scene: bpy.types.Scene) -> Worker:
    kept = session.get(RenderWorker)
    if kept.worker is not None:
        kept.worker.poll()
        if kept.worker.ended:
            kept.close()
    return kept.start(scene)
