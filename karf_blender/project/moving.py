"""A project that was begun in an unsaved file lies in the extension's own folder; from there it moves beside the .blend.

It is copied, the .blend is saved with its new place, and only then the old folder goes, unless other files use it. At the
first save of such a file the user is asked whether it shall move.
"""

import contextlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import session
from ..engine_api import BadRequest, DataError
from ..host import windows
from . import captures, disk, folders

USERS = "used_by.txt"  # in a project of the extension's own folder: the .blend files that were saved with it
ASK_SECONDS = 0.1  # after a save, until Blender takes questions again


@dataclass
class MovedProjects:
    """Where the file's projects have moved from and to: undo knows their old places."""

    per_file = True
    places: dict[Path, Path] = field(default_factory=dict)


@dataclass
class AskedProjects:
    """The projects that the user was asked about in this session."""

    paths: set[str] = field(default_factory=set)


def is_hidden(scene: bpy.types.Scene) -> bool:
    """Whether the scene's project lies in the extension's own folder, where nobody looks for it."""
    if not scene.karf.project:
        return False
    return _own_folder() in folders.project_of(scene).folder.parents


def place_beside(scene: bpy.types.Scene) -> Path:
    """A folder beside the .blend for the scene's project, which is not there yet."""
    wanted = place = Path(bpy.data.filepath).parent / f"{folders.project_of(scene).folder.name}_karf"
    number = 2
    while place.exists():
        place, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
    return place


def move(scene: bpy.types.Scene) -> Path:
    """Move the scene's project beside the .blend, and save that.

    Returns:
        The project's new folder.

    Raises:
        BadRequest: The file was never saved.
        DataError: The folder cannot be written; then all is as it was. Or the .blend cannot: then the project lies in both
            places.
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
    """Let scenes, images and strips know a folder by its new place."""
    folders.relocate(old, new)
    for image in bpy.data.images:
        if image.filepath and (place := folders.relocated(image.filepath, old, new)) != image.filepath:
            image.filepath = place
    for strip in _picture_strips():
        strip.directory = folders.relocated(strip.directory, old, new)


def _picture_strips() -> "Iterator[bpy.types.Strip]":
    editors = [scene.sequence_editor for scene in bpy.data.scenes if scene.sequence_editor is not None]
    for editor in editors:
        # an empty collection is false, so the name is asked for, not the strips; Blender 4.2 and 4.3 call them sequences
        strips = editor.strips_all if hasattr(editor, "strips_all") else editor.sequences_all
        yield from (strip for strip in strips if strip.type == "IMAGE")


def _own_folder() -> Path:
    return Path(bpy.utils.extension_path_user(extension, path="projects"))


def _users(project: Path) -> set[str]:
    """The .blend files that were saved with a project, and are still there."""
    try:
        lines = (project / USERS).read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return {line for line in lines if Path(line).is_file()}


# --- asking --------------------------------------------------------------------------------------------------------
def window_to_ask() -> bpy.types.Window | None:
    """A window whose scene has a project that nobody was asked about yet, and nobody wants to leave where it is."""
    asked = session.get(AskedProjects).paths
    for window in bpy.data.window_managers[0].windows:
        karf = window.scene.karf
        if is_hidden(window.scene) and not karf.stays_hidden and karf.project not in asked:
            return window
    return None


def _ask() -> None:
    """The timer: asks by the operator that moves the project, unless a job is at work; the next save asks then."""
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
