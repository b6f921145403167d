"""Paths of files: as the .blend stores them (relative to it once it is saved) and as absolute paths."""

import os
from collections.abc import Callable, Iterable
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
    """Return the path as the .blend stores it: `//...` relative to a saved file if the user prefers it, else absolute."""
    return _relative(path, bpy.data.filepath if blend is None else blend) if _prefers_relative() else str(path)


def _relative(path: Path, blend: str) -> str:
    if not blend:
        return str(path)
    try:
        return bpy.path.relpath(str(path), start=str(Path(blend).parent))
    except ValueError:  # another drive
        return str(path)


def _prefers_relative() -> bool:
    return bpy.context.preferences.filepaths.use_relative_paths


def file_of(scene: bpy.types.Scene) -> str:
    """Return the .blend that the scene's paths are relative to: of a linked scene its own; empty if never saved."""
    library = scene.library
    return bpy.path.abspath(library.filepath, library=library.parent) if library else bpy.data.filepath


def place_of(scene: bpy.types.Scene, name: str) -> Path | None:
    """Return the absolute path of one of the scene's `PATH_PROPERTIES`; None if it is empty."""
    path = getattr(scene.karf, name)
    return absolute(path, file_of(scene)) if path else None


def text_of(scene: bpy.types.Scene, name: str) -> str:
    """Return `place_of` as text; empty stays empty."""
    return str(place_of(scene, name) or "")


def store(scene: bpy.types.Scene, name: str, path: Path) -> None:
    """Set one of the scene's `PATH_PROPERTIES`."""
    setattr(scene.karf, name, stored(path, file_of(scene)))


def project_of(scene: bpy.types.Scene) -> Project:
    """Return the scene's project; raise BadRequest if none is chosen."""
    place = place_of(scene, "project")
    if place is None:
        raise BadRequest("The scene {name!r} has no KaRF project.", "Import a capture first.", name=scene.name)
    return Project(place)


def out_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder for results: the chosen one, else `out` in the project."""
    return place_of(scene, "out") or project_of(scene).path("out")


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


def likely_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder that a file dialog opens: that of the .blend, or else of the scene's results."""
    return Path(bpy.data.filepath).parent if bpy.data.filepath else likely_project(scene)


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


def rewrite_paths(rewrite: Callable[[str], str], scenes: Iterable[bpy.types.Scene] | None = None) -> None:
    """Replace the stored paths of scenes (default: all that are not linked) by what `rewrite` returns."""
    session.get(PathRewriting).is_on = True
    try:
        for scene in scenes or [each for each in bpy.data.scenes if each.library is None]:
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


@session.handler("blend_import_post", phase=session.Phase.STATE)
def _after_import(context, *_):
    """Rewrite the paths of appended scenes, which are relative to the file that they come from."""
    for item in context.import_items:
        if item.id_type == "SCENE" and item.id is not None and item.id.library is None:
            _rebase(bpy.path.abspath(item.source_library.filepath), bpy.data.filepath, [item.id])


def _rebase(source: str, target: str, scenes: Iterable[bpy.types.Scene] | None = None) -> None:
    """Rewrite relative paths for another place of the .blend; an empty place: absolute."""

    def rewrite(path: str) -> str:
        is_relative = path.startswith("//") or _prefers_relative()
        return _relative(absolute(path, source), target) if is_relative else path

    rewrite_paths(rewrite, scenes)
