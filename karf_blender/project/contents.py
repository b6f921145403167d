"""Read a scene's project and folder of masks: finished stages, edit planes, masks.

Every function reads the disk; for drawing use `disk.contents_of`.
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
from . import folders

GRACE_SECONDS = 5.0  # tolerance: a stage copies masks into the project as its last action
LOOK_SECONDS = 30.0  # after which masks that others have overwritten in place are noticed


@dataclass
class MaskFolders:
    """Listings of folders of masks, each with its key."""

    listings: dict[Path, tuple[tuple[int, int], tuple[int, float, tuple[Path, ...]]]] = field(default_factory=dict)


def finished_stages(scene: bpy.types.Scene) -> frozenset[str]:
    """Return the finished stages of the scene's project."""
    return frozenset(_state(scene).get("stages", ()))


def learned_with(scene: bpy.types.Scene) -> tuple[str, str]:
    """Return the preset and the pretrained NeRF of the geometry; empty if there is none."""
    state = _state(scene)
    geometry = state.get("stages", {}).get("geometry")
    if geometry is None:
        return "", ""
    return state.get("settings", {}).get("preset", ""), geometry.get("nerf", "")


def outdated(scene: bpy.types.Scene) -> frozenset[str]:
    """Return the stages with a result of other data than the present."""
    stages = finished_stages(scene)
    if not scene.karf.project:
        return stages
    project = Project(folders.project_of(scene).folder, dict(_state(scene)) or None)  # reads project.json once
    results = {"segmentation": project.segmentation_file, "recoloring": project.palette_file}
    again = _state(scene).get("outdated", ())
    # earlier versions of the engine list no outdated stages, but keep their files
    found = {name for name, file in results.items() if name not in stages and (name in again or file.exists())}
    if "segmentation" in stages and _newest_mark(scene, project) > _written(project.segmentation_file) + GRACE_SECONDS:
        found.add("segmentation")
    return frozenset(found)


def _newest_mark(scene: bpy.types.Scene, project: Project) -> float:
    """Return the last change of a mask, correction or volume, in seconds as the disk counts."""
    roots = [folders.absolute(scene.karf.masks)] if scene.karf.masks else []
    objects = [each for root in (*roots, project.corrections_folder) for each in _folders_in(root)]
    written = [_marks_below(each)[1] for each in objects]
    written += [project.volumes_file.stat().st_mtime] if project.volumes_file.exists() else []
    return max(written, default=0.0)


def _folders_in(root: Path) -> list[Path]:
    """Return the sorted folders in a folder, which need not exist."""
    return sorted(each for each in root.iterdir() if each.is_dir()) if root.is_dir() else []


def _marks_below(folder: Path) -> tuple[int, float]:
    """Return the number of PNG files below a folder, and their last change in seconds."""
    look = int(time.monotonic() // LOOK_SECONDS)
    key = folder.stat().st_mtime_ns, look  # it is listed again when it has another time, or after a while
    listings = session.get(MaskFolders).listings
    if folder not in listings or listings[folder][0] != key:
        listings[folder] = key, _list_marks(folder, key[0])
    count, written, folders = listings[folder][1]
    below = [_marks_below(each) for each in folders]
    return count + sum(own for own, _ in below), max([written, *(own for _, own in below)])


def _list_marks(folder: Path, written_ns: int) -> tuple[int, float, tuple[Path, ...]]:
    """Return the same of a folder alone, and its folders."""
    count, written, folders = 0, written_ns / 1e9, []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                folders.append(Path(entry.path))
            elif entry.name.lower().endswith(".png"):
                count += 1
                with suppress(OSError):  # a link to nowhere
                    written = max(written, entry.stat().st_mtime)
    return count, written, tuple(folders)


def forget_marks() -> None:
    """List all folders of masks again next time."""
    session.get(MaskFolders).listings.clear()


def _written(path: Path) -> float:
    return path.stat().st_mtime if path.exists() else float("inf")


def _state(scene: bpy.types.Scene) -> Mapping[str, Any]:
    """Return the content of project.json; empty before anything is learned."""
    return _state_of(folders.project_of(scene)) if scene.karf.project else {}


def _state_of(project: Project) -> Mapping[str, Any]:
    try:
        return _read_state(project.folder, *_key_of(project.state_file))
    except (OSError, KarfError):
        return {}


@lru_cache(maxsize=4)
def _read_state(folder: Path, written: int, size: int) -> Mapping[str, Any]:
    return MappingProxyType(Project(folder).state())


def _key_of(path: Path) -> tuple[int, int]:
    """Return the time and size of a file, which tell whether it has changed. Raises OSError if it is gone."""
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def planes_file(scene: bpy.types.Scene) -> Path:
    """Return the planes file of the scene's active view.

    Raises:
        BadRequest: No view of the capture is chosen.
    """
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
        return _planes_made_from(file, *_key_of(file)) == result_fingerprint(_state_of(project), "recoloring")
    except (OSError, KarfError):
        return False


@lru_cache(maxsize=64)
def _planes_made_from(file: Path, written: int, size: int) -> str:
    return planes_made_from(file)


def seen_folder(scene: bpy.types.Scene) -> Path:
    """Return the engine's folder of single views: a rendering, the masks of objects, and where these are unsure.

    Its name depends on what is learned, so older renderings are in other folders.
    """
    project = folders.project_of(scene)
    return project.path("seen", result_fingerprint(_state_of(project), "segmentation"))


def seen_rendering(scene: bpy.types.Scene) -> Path | None:
    """Return the rendering of the active view; None if there is none of what is learned now."""
    file = seen_folder(scene) / "render" / f"{scene.karf.active_view}.png"
    return file if file.is_file() else None


def seen_masks(scene: bpy.types.Scene) -> dict[str, Path]:
    """Return the masks of the active view from the last segmentation, by object."""
    files = sorted(seen_folder(scene).glob(f"masks/*/{scene.karf.active_view}.png"))
    return {file.parent.name: file for file in files}


def seen_doubts(scene: bpy.types.Scene) -> list[Path]:
    """Return the pictures of what is unsure of each object in the active view, if rendered."""
    return sorted(seen_folder(scene).glob(f"unsure/*/{scene.karf.active_view}.png"))


def mask_counts(scene: bpy.types.Scene) -> dict[str, int]:
    """Return the number of masks of each object in the chosen folder of masks."""
    objects = _folders_in(folders.absolute(scene.karf.masks)) if scene.karf.masks else []
    counts = {each.name: _marks_below(each)[0] for each in objects}
    return {name: count for name, count in counts.items() if count}


def views_to_mark(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Return the views whose mark would decide most according to the last segmentation, the best first."""
    return tuple(name for name in _reported(scene, "suggestions") if name in scene.karf.views)


def any_view_helps(scene: bpy.types.Scene) -> bool:
    """Return whether a mark in any other view would decide about as much."""
    return _report(scene).get("any_view_helps") is True


def unsure_objects(scene: bpy.types.Scene) -> tuple[tuple[str, float, bool], ...]:
    """Return each object's name, its unsure share in [0, 1], and whether that is mostly unseen by marked photos."""
    try:
        return tuple(
            (name, float(each["share"]), each["unseen"] > 0.5) for name, each in _reported(scene, "unsure").items()
        )
    except (KeyError, TypeError, ValueError):
        return ()


def _reported(scene: bpy.types.Scene, key: str) -> Mapping[str, Any]:
    """Return a table of the last segmentation's report; empty if there is none."""
    found = _report(scene).get(key)
    return found if isinstance(found, dict) else {}


def _report(scene: bpy.types.Scene) -> Mapping[str, Any]:
    """Return the last segmentation's report; empty if there is none."""
    if "segmentation" not in finished_stages(scene):
        return {}
    try:
        found = read_json(folders.project_of(scene).segmentation_report, "report")
    except (OSError, KarfError):  # a damaged report must not stop the panels
        return {}
    return found if isinstance(found, dict) else {}
