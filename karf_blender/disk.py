"""What the disk holds, as it was looked at last: drawing and polls, which run at every redraw, only read this.

A slow timer looks anew, and so do the events that change something: a job's end, a folder chosen, a mask saved, undo,
load and save. In background mode nothing is drawn and timers never fire: there every question looks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from . import folders, masks, preferences, recolor, windows
from .engine_api import KarfError, MissingDependency

HAS_TIMER = not bpy.app.background
LOOK_SECONDS = 2.0


@dataclass(frozen=True)
class Seen:
    """What there is of one scene.

    missing: the scene's project folder where it is gone, else None. stages: finished ones. is_prepared: whether the
    active view has edit planes. masks: the number of masks of each marked object.
    """

    missing: Path | None = None
    stages: frozenset[str] = frozenset()
    is_prepared: bool = False
    masks: Mapping[str, int] = field(default_factory=dict)


class _Memory:
    """What was seen last: each scene's under what it depends on, and why there is no engine."""

    scenes: Mapping[tuple[str, ...], Seen] = {}
    engine_problem: str = ""


def seen(scene: bpy.types.Scene) -> Seen:
    """What there was of the scene when the disk was looked at last; nothing where that has not happened yet."""
    _look_if_untimed()
    return _Memory.scenes.get(_key(scene), Seen())


def engine_problem() -> str:
    """Why there is no Python for the engine, with the remedy; empty where there is one."""
    _look_if_untimed()
    return _Memory.engine_problem


def look() -> bool:
    """Look at the disk for all scenes of the open file; True where something has changed. Never raises."""
    before = _Memory.scenes, _Memory.engine_problem
    _Memory.scenes = {_key(scene): _look_at(scene) for scene in bpy.data.scenes}
    _Memory.engine_problem = _look_for_engine()
    return before != (_Memory.scenes, _Memory.engine_problem)


def _look_if_untimed() -> None:
    if not HAS_TIMER:
        look()


def _key(scene: bpy.types.Scene) -> tuple[str, ...]:
    karf = scene.karf
    return bpy.data.filepath, karf.project, karf.masks, karf.active_view


def _look_at(scene: bpy.types.Scene) -> Seen:
    try:
        if scene.karf.project and not (folder := folders.project_of(scene).folder).is_dir():
            return Seen(missing=folder)
        stages, marked = folders.finished_stages(scene), masks.marked(scene)
        return Seen(None, stages, recolor.is_prepared(scene), marked)
    except (OSError, KarfError):  # unreadable, or gone while it was looked at
        return Seen()


def _look_for_engine() -> str:
    try:
        preferences.engine_python()
    except MissingDependency as error:
        return f"{error.sentence} {error.hint}"
    return ""


# --- timer and handlers --------------------------------------------------------------------------------------------
def _tick() -> float:
    if look():
        windows.redraw(*windows.PANEL_AREAS)
    return LOOK_SECONDS


@persistent
def _after_change(*_):
    look()


HANDLERS = ("load_post", "save_post", "undo_post", "redo_post")


def register():
    """Called when the extension is enabled."""
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).append(_after_change)
    if HAS_TIMER:
        bpy.app.timers.register(_tick, persistent=True)


def unregister():
    """Called when the extension is disabled."""
    # a timer left behind hangs or crashes some Blender versions at exit
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for name in HANDLERS:
        getattr(bpy.app.handlers, name).remove(_after_change)
    _Memory.scenes, _Memory.engine_problem = {}, ""
