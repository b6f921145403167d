"""A snapshot of the files of all scenes, for drawing and polls, which run at every redraw.

A slow timer refreshes it, and so does every change: a job's end, another folder, a new mask, undo, load and save. In
background mode nothing is drawn and timers never fire: there each call reads the disk.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .. import session
from ..engine_api import KarfError
from ..host import windows
from ..preferences import color_book, state
from . import contents, folders

HAS_TIMER = not bpy.app.background
REFRESH_SECONDS = 2.0
READ = "disk_read"  # event, where anything is drawn


@dataclass(frozen=True)
class Contents:
    """The state of one scene's files."""

    missing: Path | None = None  # the scene's project folder where it is gone
    stages: frozenset[str] = frozenset()  # the finished ones
    outdated: frozenset[str] = frozenset()  # stages whose result is of other masks, or of another earlier stage
    learned_with: tuple[str, str] = ("", "")  # the preset and the pretrained NeRF of the geometry
    is_prepared: bool = False  # whether the active view has edit planes
    is_rendered: bool = False  # whether what is learned was rendered from the active view's camera
    is_doubted: bool = False  # whether pictures of what is unsure were rendered from it
    masks: Mapping[str, int] = field(default_factory=dict)  # their number, of each object that has some
    suggested: tuple[str, ...] = ()  # the views whose mark would decide most, the best first
    any_view_helps: bool = False  # whether a mark in any other view would decide about as much
    unsure: tuple[tuple[str, float, bool], ...] = ()  # see `contents.unsure_objects`


@dataclass
class LastRead:
    """The snapshot: the files of each scene."""

    scenes: Mapping[tuple[str, ...], Contents] = field(default_factory=dict)


def contents_of(scene: bpy.types.Scene) -> Contents:
    """Return the scene's files as of the last refresh; nothing before the first one."""
    if not HAS_TIMER:
        refresh()
    return session.get(LastRead).scenes.get(_key(scene), Contents())


def refresh(lists_again: bool = True) -> bool:
    """Read the disk for all scenes of the open file; True after a change. Never raises.

    lists_again: Also list folders of masks whose times have not changed.
    """
    if lists_again:
        contents.forget_marks()
    last = session.get(LastRead)
    before, last.scenes = last.scenes, {_key(scene): _read(scene) for scene in bpy.data.scenes}
    has_new_engine, has_new_book = state.refresh(), color_book.refresh()
    if HAS_TIMER:
        session.notify(READ)
    return has_new_engine or has_new_book or before != last.scenes


def _key(scene: bpy.types.Scene) -> tuple[str, ...]:
    karf = scene.karf
    return bpy.data.filepath, karf.project, karf.masks, karf.active_view


def _read(scene: bpy.types.Scene) -> Contents:
    has_project = bool(scene.karf.project)
    try:
        if has_project and not (folder := folders.project_of(scene).folder).is_dir():
            return Contents(missing=folder)
        return Contents(
            stages=contents.finished_stages(scene),
            outdated=contents.outdated(scene),
            learned_with=contents.learned_with(scene),
            is_prepared=contents.is_prepared(scene),
            is_rendered=has_project and contents.seen_rendering(scene) is not None,
            is_doubted=has_project and bool(contents.seen_doubts(scene)),
            masks=contents.mask_counts(scene),
            suggested=contents.views_to_mark(scene),
            any_view_helps=contents.any_view_helps(scene),
            unsure=contents.unsure_objects(scene),
        )
    except (OSError, KarfError):  # unreadable, or gone while it was read
        return Contents()


# --- timer and handlers --------------------------------------------------------------------------------------------
def _tick() -> float:
    if refresh(lists_again=False):
        windows.redraw("PREFERENCES", *windows.PANEL_AREAS)
    return REFRESH_SECONDS


@session.handler("load_post", "save_post", "undo_post", "redo_post")
def _after_change(*_):
    refresh()


@session.setup
def _watch():
    if HAS_TIMER:
        session.start_timer(_tick, persistent=True)
    yield
