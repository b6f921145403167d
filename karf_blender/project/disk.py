"""What the disk held when it was read last: drawing and polls, which run at every redraw, ask only this.

A slow timer reads it again, and so do the events that change something: a job's end, a folder chosen, a mask saved,
undo, load and save. In background mode nothing is drawn and timers never fire: there every question reads the disk.
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
    """What there is of one scene's files.

    Attributes:
        missing: The scene's project folder where it is gone, else None.
        stages: The finished ones.
        outdated: Those whose result is of other masks or of an earlier stage's former result.
        learned_with: The preset and the pretrained NeRF that the geometry was learned with.
        is_prepared: Whether the active view has edit planes.
        is_rendered: Whether what is learned was rendered from the active view's camera.
        is_doubted: Whether pictures of what is unsure were rendered from it.
        masks: The number of masks of each object that has some.
        suggested: The views whose mark would decide most, the best first.
        any_view_helps: Whether a mark in any other view would decide about as much.
        unsure: How unsure each object is, see `contents.unsure_objects`.
    """

    missing: Path | None = None
    stages: frozenset[str] = frozenset()
    outdated: frozenset[str] = frozenset()
    learned_with: tuple[str, str] = ("", "")
    is_prepared: bool = False
    is_rendered: bool = False
    is_doubted: bool = False
    masks: Mapping[str, int] = field(default_factory=dict)
    suggested: tuple[str, ...] = ()
    any_view_helps: bool = False
    unsure: tuple[tuple[str, float, bool], ...] = ()


@dataclass
class _State:
    """What was read last, each scene's under what it depends on."""

    scenes: Mapping[tuple[str, ...], Contents] = field(default_factory=dict)


def contents_of(scene: bpy.types.Scene) -> Contents:
    """What there was of the scene when the disk was read last; nothing where that has not happened yet."""
    _refresh_if_untimed()
    return session.get(_State).scenes.get(_key(scene), Contents())


def refresh() -> bool:
    """Read the disk for all scenes of the open file; True where something has changed. Never raises."""
    contents.forget_marks()
    return _refresh()


def _refresh() -> bool:
    """The same, without looking into folders of masks whose times have not changed."""
    before = session.get(_State).scenes
    session.get(_State).scenes = {_key(scene): _read(scene) for scene in bpy.data.scenes}
    has_new_engine, has_new_book = state.refresh(), color_book.refresh()
    if HAS_TIMER:
        session.notify(READ)
    return has_new_engine or has_new_book or before != session.get(_State).scenes


def _refresh_if_untimed() -> None:
    if not HAS_TIMER:
        refresh()


def _key(scene: bpy.types.Scene) -> tuple[str, ...]:
    karf = scene.karf
    return bpy.data.filepath, karf.project, karf.masks, karf.active_view


def _read(scene: bpy.types.Scene) -> Contents:
    try:
        if scene.karf.project and not (folder := folders.project_of(scene).folder).is_dir():
            return Contents(missing=folder)
        stages, masks = contents.finished_stages(scene), contents.mask_counts(scene)
        outdated, learned_with = contents.outdated(scene), contents.learned_with(scene)
        told = contents.views_to_mark(scene), contents.any_view_helps(scene), contents.unsure_objects(scene)
        return Contents(None, stages, outdated, learned_with, *_view(scene), masks, *told)
    except (OSError, KarfError):  # unreadable, or gone while it was read
        return Contents()


def _view(scene: bpy.types.Scene) -> tuple[bool, bool, bool]:
    """Whether the active view is prepared, and whether what is learned and what is unsure were rendered from its camera."""
    if not scene.karf.project:
        return False, False, False
    is_rendered, is_doubted = contents.seen_rendering(scene) is not None, bool(contents.seen_doubts(scene))
    return contents.is_prepared(scene), is_rendered, is_doubted


# --- timer and handlers --------------------------------------------------------------------------------------------
def _tick() -> float:
    if _refresh():
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
