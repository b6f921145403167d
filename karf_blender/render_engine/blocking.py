"""Blocking queries from the render thread, which waits for each picture and can cancel it.

They use a separate worker, as the timer polls the interface's worker on the main thread meanwhile. It stays for the
next frame of an animation, and ends when none comes for a while.
"""

import time
from collections.abc import Callable
from typing import Any

import bpy

from .. import session
from ..engine.worker import error_from_event
from ..engine_api import Cancelled, KarfError
from ..project import folders
from ..tasks.queries import WarmWorker

POLL_SECONDS = 0.005


class RenderWorker(WarmWorker):
    """The worker of the render thread."""

    idle_minutes = 1


def ask(scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict[str, Any]:
    """Send a query, one of the engine's `queries.QUERIES`, and return its answer; the caller deletes files that it names.

    The default of the option `project` is the scene's; paths are absolute. Raises Cancelled when `is_cancelled` returns
    True, which ends the worker, and KarfError if the engine does not answer.
    """
    options = {"project": str(folders.project_of(scene).folder), **options}
    for _ in range(2):  # an idle worker may end just before the query
        answer = _answer(scene, kind, options, is_cancelled)
        if answer is not None:
            return answer
    raise KarfError("The engine exited before it answered.", "Try again.")


def stop() -> None:
    """End the worker and remove its folder."""
    session.get(RenderWorker).close()


def _answer(
    scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """Return the answer's values; None if the worker has ended without a failure before."""
    kept = session.get(RenderWorker)
    if kept.worker is not None:
        kept.worker.poll()
        if kept.worker.ended:
            kept.close()
    worker = kept.start(scene)
    worker.query(kind, options, kind)
    while True:
        for _, event in worker.replies():
            if event.kind == "answer":
                return {name: value for name, value in event.values.items() if name != "id"}
            if event.kind == "refused":
                raise error_from_event(event)
        if worker.ended:
            kept.leave()
            return None
        if is_cancelled():
            stop()
            raise Cancelled("The render was cancelled.")
        time.sleep(POLL_SECONDS)
