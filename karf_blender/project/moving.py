"""Move a project from the extension's folder, where unsaved files have theirs, to the folder of the .blend.

The first save of such a file asks the user whether to move it.
"""

import contextlib
import shutil
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import session
from ..engine_api import BadRequest, DataError
from ..host import compat, windows
from . import captures, disk, folders

USERS = "used_by.txt"  # in a project in the extension's folder: the .blend files that use it
ASK_SECONDS = 0.1  # after a save, until Blender takes questions again


@dataclass
class MovedProjects:
    per_file = True
    places: dict[Path, Path] = field(default_factory=dict)  # old and new folders: undo restores old paths


@dataclass
class AskedProjects:
    paths: set[str] = field(default_factory=set)


def is_hidden(scene: bpy.types.Scene) -> bool:
    """Return whether the scene's project is in the extension's folder, where users do not find it."""
    return bool(scene.karf.project) and _own_folder() in folders.project_of(scene).folder.parents


def _own_folder() -> Path:
    return Path(bpy.utils.extension_path_user(extension, path="projects"))


def place_beside(scene: bpy.types.Scene) -> Path:
    """Return a new folder beside the .blend for the scene's project."""
    wanted = Path(bpy.data.filepath).parent / f"{folders.project_of(scene).folder.name}_karf"
    places = (wanted if number == 1 else wanted.with_name(f"{wanted.name}_{number}") for number in count(1))
    return next(place for place in places if not place.exists())


def move(scene: bpy.types.Scene) -> Path:
    """Move the scene's project beside the .blend, save the file, and return the project's new folder.

    Raises BadRequest if the file was never saved; DataError if the folder cannot be written, and nothing has changed, or
    if the .blend cannot be saved: then the project is in both places.
    """
    if not bpy.data.filepath:
        raise BadRequest("This file has not been saved yet.", "Save it first: the project moves to the file's folder.")
    old, new = folders.project_of(scene).folder, place_beside(scene)
    _copy(old, new)
    session.get(MovedProjects).places[old] = new
    _relocate(old, new)
    captures.forget()
    disk.refresh()
    _save()
    if not _users(old) - {bpy.data.filepath}:
        shutil.rmtree(old, ignore_errors=True)
    return new


def _save() -> None:
    try:
        bpy.ops.wm.save_mainfile()
    except RuntimeError as error:
        raise DataError(
            "The project has moved, but the file could not be saved ({error}).",
            "Save it: the file on disk still refers to the project's old place, where the project still exists.",
            error=str(error).strip().rpartition(":")[2].strip(),
        ) from error


def _copy(old: Path, new: Path) -> None:
    partial = new.with_name(f".{new.name}.partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        shutil.copytree(old, partial, symlinks=True, ignore=shutil.ignore_patterns(USERS))
        partial.rename(new)
    except OSError as error:  # shutil's own errors are among them
        shutil.rmtree(partial, ignore_errors=True)
        raise DataError(
            "The project cannot be copied to {path} ({error}).",
            "Free some space, or save the file elsewhere. The project stays where it is.",
            path=new,
            error=error.strerror or "files were not copied",
        ) from error


def _relocate(old: Path, new: Path) -> None:
    folders.rewrite_paths(lambda path: folders.relocated(path, old, new))
    for image in bpy.data.images:
        if image.filepath and (place := folders.relocated(image.filepath, old, new)) != image.filepath:
            image.filepath = place
    for strip in compat.all_strips():
        if strip.type == "IMAGE":
            strip.directory = folders.relocated(strip.directory, old, new)


def _users(project: Path) -> set[str]:
    try:
        lines = (project / USERS).read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return {line for line in lines if Path(line).is_file()}


def window_to_ask() -> bpy.types.Window | None:
    """Return a window whose scene has a hidden project and no answer yet."""
    asked = session.get(AskedProjects).paths
    for window in bpy.data.window_managers[0].windows:
        karf = window.scene.karf
        if is_hidden(window.scene) and not karf.stays_hidden and karf.project not in asked:
            return window
    return None


def _ask() -> None:
    """Ask by the operator that moves the project, unless a job is running; then the next save asks. A timer."""
    disk.refresh()
    window = window_to_ask()
    if window is None:
        return
    area = next(area for area in window.screen.areas if area.type in windows.PANEL_AREAS)
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        if bpy.ops.karf.move_project.poll():
            session.get(AskedProjects).paths.add(window.scene.karf.project)
            bpy.ops.karf.move_project("INVOKE_DEFAULT")


@session.handler("save_post")
def _after_save(*_):
    if not bpy.data.filepath:
        return
    for scene in bpy.data.scenes:
        if is_hidden(scene) and (folder := folders.project_of(scene).folder).is_dir():
            with contextlib.suppress(OSError):
                known = _users(folder) | {bpy.data.filepath}
                (folder / USERS).write_text("\n".join(sorted(known)), encoding="utf-8")
    if not bpy.app.background:
        session.start_timer(_ask, ASK_SECONDS)


@session.handler("undo_post", "redo_post", phase=session.Phase.STATE)
def _after_undo(*_):
    for old, new in session.get(MovedProjects).places.items():
        _relocate(old, new)
