"""Asks of the warm engine: started on demand, polled by one timer, ended when idle or with the extension.

It answers beside a running task: it only reads, and loads again what a task has learned. Where it crashes, those who
wait are told, and the next ask starts a fresh one. In background mode timers never fire: there an ask blocks.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .. import preferences, progress
from ..engine import jobs
from ..engine.warm import WarmEngine, refusal
from ..engine_api import Event, KarfError
from ..host import compat, rendering, windows
from ..project import folders
from .ownership import Owner

POLL_SECONDS = 0.02

OnAnswer = Callable[[bpy.types.Scene, dict[str, Any]], None]
OnError = Callable[[KarfError], None]


@dataclass(frozen=True)
class _Asked:
    """An ask on its way: who began it, what follows, and whether a fresh engine was already tried."""

    owner: Owner
    kind: str
    options: dict
    on_answer: OnAnswer
    on_error: OnError
    is_second: bool = False


class _Memory:
    """The engine at work, if one is."""

    engine: WarmEngine | None = None


def ask(
    scene: bpy.types.Scene, kind: str, options: dict[str, Any], on_answer: OnAnswer, on_error: OnError | None = None
) -> None:
    """Ask the warm engine and return at once; in background mode, block until it has answered.

    A later ask of the same kind takes the place of one that has not begun, of which nothing more is heard; so it is
    with an answer that comes when the scene is gone or has another project.

    Args:
        scene: One with a project, which the option `project` names if it is not given.
        kind: One of the engine's `warm.answers.ANSWERS`.
        options: JSON values, paths absolute.
        on_answer: Called with the scene and the answer's values; files that these name are the caller's to delete.
        on_error: Called with why there is no answer; by default the panel says it, and in background mode it is raised.

    Raises:
        KarfError: The engine cannot be started; in background mode also: there is no answer.
    """
    _begin(scene, kind, options, on_answer, on_error or _fail)
    if bpy.app.background:
        _wait(kind)
    elif not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=POLL_SECONDS, persistent=True)


def wait(scene: bpy.types.Scene, kind: str, options: dict[str, Any]) -> dict[str, Any]:
    """Ask, block until the engine has answered, and return the answer's values; arguments as for `ask`.

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


def _begin(scene: bpy.types.Scene, kind: str, options: dict, on_answer: OnAnswer, on_error: OnError) -> None:
    options = {"project": str(folders.project_of(scene).folder), **options}
    _engine(scene).ask(kind, options, _Asked(Owner.of(scene), kind, options, on_answer, on_error))


def _wait(kind: str) -> None:
    while is_waiting(kind):
        time.sleep(POLL_SECONDS / 2)
        _poll()


def is_waiting(kind: str) -> bool:
    """Whether an ask of this kind has no answer yet."""
    engine = _Memory.engine
    return engine is not None and any(asked.kind == kind for asked in engine.waiting.values())


def stop() -> None:
    """End the engine; of what was asked nothing more is heard."""
    if _Memory.engine is not None:
        _Memory.engine.end()
        _Memory.engine = None


def _engine(scene: bpy.types.Scene) -> WarmEngine:
    """The engine at work, as the preferences want it; a fresh one where there is none."""
    wanted = preferences.engine_python(), preferences.current().threads
    _poll()  # it may have ended since somebody waited last
    if _Memory.engine is not None and _Memory.engine.made_for != wanted:
        stop()
    if _Memory.engine is None:
        python, threads = wanted
        _Memory.engine = WarmEngine(python, folders.project_of(scene).folder, threads)
    return _Memory.engine


def _poll() -> None:
    """Hand out what was answered, and take leave of an engine that has ended."""
    engine = _Memory.engine
    for asked, event in list(engine.poll()) if engine else ():
        _hand_out(asked, event)
    if engine is not None and engine.ended and engine is _Memory.engine:
        _Memory.engine = None
        error, lost = engine.error(), list(engine.waiting.values())
        engine.end()
        for asked in lost:
            if error is None and not asked.is_second:
                _ask_again(asked)
            else:
                asked.on_error(error or KarfError("The warm engine ended before it answered.", "Try again."))


def _hand_out(asked: _Asked, event: Event) -> None:
    scene = asked.owner.find()
    if event.kind == "dropped" or scene is None:
        return
    try:
        if event.kind == "refused":
            raise refusal(event)
        asked.on_answer(scene, {name: value for name, value in event.values.items() if name != "id"})
    except KarfError as error:
        asked.on_error(error)
    except OSError as error:  # what follows writes masks: were it raised, nobody would hear of other answers any more
        asked.on_error(jobs.disk_error(error))


def _ask_again(asked: _Asked) -> None:
    """Ask a fresh engine: the other one had just ended for want of asks."""
    scene = asked.owner.find()
    if scene is not None:
        _engine(scene).ask(asked.kind, asked.options, replace(asked, is_second=True))


def _fail(error: KarfError) -> None:
    """Nobody took care of an error."""
    if bpy.app.background:
        raise error
    progress.fail(error)
    windows.redraw(*windows.PANEL_AREAS)


def _tick() -> float | None:
    """The timer: runs as long as somebody waits for an answer."""
    if rendering.is_over():  # what follows an answer touches pixels and data
        _poll()
    return POLL_SECONDS if _Memory.engine is not None and _Memory.engine.waiting else None


@persistent
def _before_exit(*_):
    stop()


def register():
    """Called when the extension is enabled."""
    if compat.exit_handlers() is not None:
        compat.exit_handlers().append(_before_exit)


def unregister():
    """Called when the extension is disabled."""
    if compat.exit_handlers() is not None:
        compat.exit_handlers().remove(_before_exit)
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    stop()
