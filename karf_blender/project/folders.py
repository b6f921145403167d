"""Paths of files: as the .blend stores them (relative to it once it is saved) and as absolute paths."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from ... import __package__ as extension
from .. import session
from ..engine_api import BadRequest, Project

PATH_PROPERTIES = ("project", "capture", "masks", "out", "frames", "nerf", "ocio")


def absolute(stored: str, blend: str | None = None) -> Path:
    """Return the absolute path of one stored in the .blend (default: the open one), without `..`."""
    start = str(Path(blend).parent) if blend else None
    return Path(os.path.normpath(bpy.path.abspath(stored, start=start)))


def stored(path: Path, blend: str | None = None) -> str:
    """Return the path as the .blend stores it: `//...` relative to a saved file, else absolute."""
    blend = bpy.data.filepath if blend is None else blend
    if not blend:
        return str(path)
    try:
        return bpy.path.relpath(str(path), start=str(Path(blend).parent))
    except ValueError:  # another drive
        return str(path)


def project_of(scene: bpy.types.Scene) -> Project:
    """Return the scene's project; raise BadRequest if none is chosen."""
    if not scene.karf.project:
        raise BadRequest("The scene {name!r} has no KaRF project.", "Import a capture first.", name=scene.name)
    return Project(absolute(scene.karf.project))


def out_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder for results: the chosen one, else `out` in the project."""
    return absolute(scene.karf.out) if scene.karf.out else project_of(scene).path("out")


def absolute_text(stored: str) -> str:
    """Return the absolute path of one stored in the .blend as text; empty stays empty."""
    return str(absolute(stored)) if stored else ""


def default_project(capture: Path) -> Path:
    """Return a project folder for this capture: next to the saved .blend, else in the extension's folder."""
    name = (capture.parent if capture.is_file() else capture).name
    if bpy.data.filepath:
        return Path(bpy.data.filepath).parent / f"{name}_karf"
    return Path(bpy.utils.extension_path_user(extension, path=f"projects/{name}", create=True))


def likely_project(scene: bpy.types.Scene) -> Path:
    """Return the folder of the scene's project, or of its next one; nothing is created."""
    if scene.karf.project:
        return project_of(scene).folder
    return Path(bpy.data.filepath).parent if bpy.data.filepath else Path(bpy.utils.extension_path_user(extension))


def relocated(path: str, old: Path, new: Path) -> str:
    """Return a stored path with its new place if it is in the moved folder; any other unchanged."""
    place = absolute(path) if path else None
    if place is None or (place != old and old not in place.parents):
        return path
    return stored(new / place.relative_to(old))


@dataclass
class PathRewriting:
    is_on: bool = False


def is_rewriting() -> bool:
    """Return True while paths are rewritten: they name the same places as before."""
    return session.get(PathRewriting).is_on


def rewrite_paths(rewrite: Callable[[str], str]) -> None:
    """Replace the stored paths of all scenes by what `rewrite` returns."""
    session.get(PathRewriting).is_on = True
    try:
        for scene in bpy.data.scenes:
            for name in PATH_PROPERTIES:
                path = getattr(scene.karf, name)
                if path and (rewritten := rewrite(path)) != path:
                    setattr(scene.karf, name, rewritten)
    finally:
        session.get(PathRewriting).is_on = False


@session.handler("save_pre", phase=session.Phase.STATE)
def _before_save(target, *_):
    if isinstance(target, str) and target:
        _rebase(bpy.data.filepath, target)


@session.handler("save_post", "save_post_fail", phase=session.Phase.STATE)
def _after_save(target, *_):
    # a saved copy and a file that could not be written leave the open file where it was
    if isinstance(target, str) and target:
        _rebase(target, bpy.data.filepath)


def _rebase(source: str, target: str) -> None:
    """Rewrite relative paths for another place of the .blend; an empty place: absolute."""
    rewrite_paths(lambda path: stored(absolute(path, source), target))
