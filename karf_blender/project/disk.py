"""The files of scenes: finished stages, edit planes, renderings and masks.

Drawing and polls use `contents_of`, which a timer and each change refresh; in background mode each call reads the disk.
"""

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy

from .. import session
from ..engine_api import BadRequest, KarfError, Project, planes_made_from, read_json, result_fingerprint
from ..host import windows
from ..preferences import color_book, state
from . import folders

HAS_TIMER = not bpy.app.background
REFRESH_SECONDS = 2.0
LISTING_SECONDS = 30.0  # after which masks that others have overwritten in place are noticed
GRACE_SECONDS = 5.0  # tolerance: a stage copies masks into the project as its last action
READ = "disk_read"  # event, where anything is drawn


@dataclass(frozen=True)
class Contents:
    missing: Path | None = None  # the scene's project folder where it is gone
    stages: frozenset[str] = frozenset()  # the finished ones
    outdated: frozenset[str] = frozenset()  # stages whose result is of other masks, or of another earlier stage
    learned_with: tuple[str, str] = ("", "")  # the preset and the pretrained NeRF of the geometry
    left_out: frozenset[str] = frozenset()  # names of the photos that the geometry was learned without
    is_prepared: bool = False  # whether the active view has edit planes
    is_rendered: bool = False  # whether what is learned was rendered from the active view's camera
    is_doubted: bool = False  # whether pictures of what is unsure were rendered from it
    masks: Mapping[str, int] = field(default_factory=dict)  # their number, of each object that has some
    suggested: tuple[str, ...] = ()  # the views whose mark would decide most, the best first
    any_view_helps: bool = False  # whether a mark in any other view would decide about as much
    # of each object: name, unsure share in [0, 1], and whether that is mostly unseen by marked photos
    unsure: tuple[tuple[str, float, bool], ...] = ()
    centers: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)  # of objects, capture's world
    reached: tuple[str, str, float] = (
        "",
        "",
        0.0,
    )  # quality of the splats, how sharp held-out views are, blur in pixels
    erased: int = 0  # splats that are left out


@dataclass(frozen=True)
class MaskFolder:
    key: tuple[int, int]  # it is listed again when this has changed
    count: int  # of PNG files directly in it
    written: float  # time of the last change
    folders: tuple[Path, ...]  # in it


@dataclass
class LastRead:
    scenes: Mapping[tuple[str, ...], Contents] = field(default_factory=dict)
    mask_folders: dict[Path, MaskFolder] = field(default_factory=dict)


# --- what was read last --------------------------------------------------------------------------------------------
def contents_of(scene: bpy.types.Scene) -> Contents:
    """Return the scene's files as of the last refresh; nothing before the first one."""
    if not HAS_TIMER:
        refresh()
    return session.get(LastRead).scenes.get(_key(scene), Contents())


def refresh(lists_again: bool = True) -> bool:
    """Read the disk for all scenes, also unchanged folders if `lists_again`; True after a change. Never raises."""
    last = session.get(LastRead)
    if lists_again:
        last.mask_folders.clear()
    before, last.scenes = last.scenes, {_key(scene): read(scene) for scene in bpy.data.scenes}
    has_new_engine, has_new_book = state.refresh(), color_book.refresh()
    if HAS_TIMER:
        session.notify(READ)
    return has_new_engine or has_new_book or before != last.scenes


def _key(scene: bpy.types.Scene) -> tuple[str, ...]:
    karf = scene.karf
    return folders.file_of(scene), karf.project, karf.masks, karf.active_view


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


# --- reading -------------------------------------------------------------------------------------------------------
def read(scene: bpy.types.Scene) -> Contents:
    """Return the present state of the scene's files; nothing if they are unreadable. Never raises."""
    project = folders.project_of(scene) if scene.karf.project else None
    try:
        if project is not None and not project.folder.is_dir():
            return Contents(missing=project.folder)
        masks_folder = folders.place_of(scene, "masks")
        marked = _folders_in(masks_folder) if masks_folder else []
        counts = {folder.name: _masks_below(folder)[0] for folder in marked}
        masks = {name: count for name, count in counts.items() if count}
        if project is None:
            return Contents(masks=masks)
        found = _state_of(project)
        stages = found.get("stages", {})
        report = _report(project) if "segmentation" in stages else {}
        return Contents(
            stages=frozenset(stages),
            outdated=_outdated(project, marked),
            learned_with=_learned_with(found),
            left_out=frozenset(stages.get("geometry", {}).get("without", ())),
            is_prepared=is_prepared(scene),
            is_rendered=rendering_of(scene) is not None,
            is_doubted=bool(rendered_doubts(scene)),
            masks=masks,
            suggested=tuple(name for name in _table(report, "suggestions") if name in scene.karf.views),
            any_view_helps=report.get("any_view_helps") is True,
            unsure=_unsure(_table(report, "unsure")),
            centers=_centers(_table(report, "centers")),
            reached=_reached(stages.get("splats", {})),
            erased=stages.get("splats", {}).get("erased", 0),
        )
    except (OSError, KarfError):  # unreadable, or gone while it was read
        return Contents()


def _state_of(project: Project) -> Mapping[str, Any]:
    try:
        return _read_state(project.folder, *_time_and_size(project.state_file))
    except (OSError, KarfError):
        return {}


@lru_cache(maxsize=4)
def _read_state(folder: Path, written: int, size: int) -> Mapping[str, Any]:
    return MappingProxyType(Project(folder).state())


def _time_and_size(path: Path) -> tuple[int, int]:
    """Return what tells whether a file has changed. Raises OSError if it is gone."""
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def _learned_with(state: Mapping[str, Any]) -> tuple[str, str]:
    geometry = state.get("stages", {}).get("geometry")
    if geometry is None:
        return "", ""
    return state.get("settings", {}).get("preset", ""), geometry.get("nerf", "")


def _report(project: Project) -> Mapping[str, Any]:
    try:
        found = read_json(project.segmentation_report, "report")
    except (OSError, KarfError):  # a damaged report must not stop the panels
        return {}
    return found if isinstance(found, dict) else {}


def _table(report: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = report.get(key)
    return found if isinstance(found, dict) else {}


def _reached(splats: Mapping[str, Any]) -> tuple[str, str, float]:
    word, blur = splats.get("reached", ("", 0.0))
    return splats.get("quality", ""), word, blur


def _unsure(objects: Mapping[str, Any]) -> tuple[tuple[str, float, bool], ...]:
    try:
        return tuple((name, float(each["share"]), each["unseen"] > 0.5) for name, each in objects.items())
    except (KeyError, TypeError, ValueError):
        return ()


def _centers(objects: Mapping[str, Any]) -> Mapping[str, tuple[float, float, float]]:
    try:
        return {name: (float(x), float(y), float(z)) for name, (x, y, z) in objects.items()}
    except (TypeError, ValueError):
        return {}


# --- masks ---------------------------------------------------------------------------------------------------------
def _outdated(project: Project, marked: list[Path]) -> frozenset[str]:
    """Return the stages with a result of other data than the present; `marked`: the folders of objects' masks."""
    state = _state_of(project)
    stages, listed = state.get("stages", ()), state.get("outdated", ())
    project = Project(project.folder, dict(state) or None)  # reads project.json once
    results = {"segmentation": project.segmentation_file, "recoloring": project.palette_file}
    # earlier versions of the engine list no outdated stages, but keep their files
    found = {name for name, file in results.items() if name not in stages and (name in listed or file.exists())}
    if "segmentation" in stages and results["segmentation"].exists():
        written = [_masks_below(folder)[1] for folder in (*marked, *_folders_in(project.corrections_folder))]
        written += [project.volumes_file.stat().st_mtime] if project.volumes_file.exists() else []
        if max(written, default=0.0) > results["segmentation"].stat().st_mtime + GRACE_SECONDS:
            found.add("segmentation")
    return frozenset(found)


def _folders_in(root: Path) -> list[Path]:
    return sorted(each for each in root.iterdir() if each.is_dir()) if root.is_dir() else []


def _masks_below(folder: Path) -> tuple[int, float]:
    """Return the number of PNG files below a folder, and the time of their last change."""
    known = session.get(LastRead).mask_folders
    key = folder.stat().st_mtime_ns, int(time.monotonic() // LISTING_SECONDS)
    if folder not in known or known[folder].key != key:
        known[folder] = _list_masks(folder, key)
    below = [_masks_below(each) for each in known[folder].folders]
    count = known[folder].count + sum(each[0] for each in below)
    return count, max([known[folder].written, *(each[1] for each in below)])


def _list_masks(folder: Path, key: tuple[int, int]) -> MaskFolder:
    count, written, folders = 0, key[0] / 1e9, []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                folders.append(Path(entry.path))
            elif entry.name.lower().endswith(".png"):
                count += 1
                with suppress(OSError):  # a link to nowhere
                    written = max(written, entry.stat().st_mtime)
    return MaskFolder(key, count, written, tuple(folders))


# --- edit planes and renderings ------------------------------------------------------------------------------------
def planes_file(scene: bpy.types.Scene) -> Path:
    """Return the planes file of the scene's active view; raise BadRequest if no view of the capture is chosen."""
    if scene.karf.active_view not in scene.karf.views:
        raise BadRequest("The scene {name!r} has no active view.", "Choose one in the KaRF panel.", name=scene.name)
    return folders.project_of(scene).planes_file(scene.karf.active_view)


def is_prepared(scene: bpy.types.Scene) -> bool:
    """Return True if the active view can be recolored: it has current planes."""
    is_chosen = scene.karf.project and scene.karf.active_view in scene.karf.views
    return bool(is_chosen) and is_current(folders.project_of(scene), scene.karf.active_view)


def is_current(project: Project, view: str) -> bool:
    """Return True if the view has planes of what is learned now."""
    try:
        file = project.planes_file(view)
        return _planes_made_from(file, *_time_and_size(file)) == result_fingerprint(_state_of(project), "recoloring")
    except (OSError, KarfError):
        return False


@lru_cache(maxsize=64)
def _planes_made_from(file: Path, written: int, size: int) -> str:
    return planes_made_from(file)


def renderings_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder of what was rendered of single views (picture, masks, doubts) from what is learned now."""
    project = folders.project_of(scene)
    return project.path("seen", result_fingerprint(_state_of(project), "segmentation"))


def rendering_of(scene: bpy.types.Scene) -> Path | None:
    """Return the rendering of the active view; None if there is none of what is learned now."""
    file = renderings_folder(scene) / "render" / f"{scene.karf.active_view}.png"
    return file if file.is_file() else None


def rendered_masks(scene: bpy.types.Scene) -> dict[str, Path]:
    """Return the masks of the active view from the last segmentation, by object."""
    files = sorted(renderings_folder(scene).glob(f"masks/*/{scene.karf.active_view}.png"))
    return {file.parent.name: file for file in files}


def rendered_doubts(scene: bpy.types.Scene) -> list[Path]:
    """Return the pictures of what is unsure of each object in the active view, if rendered."""
    return sorted(renderings_folder(scene).glob(f"unsure/*/{scene.karf.active_view}.png"))
