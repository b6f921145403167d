"""The captures that scenes were made from, read once: large models take seconds."""

from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .. import session
from ..engine_api import BadRequest, Capture, View, open_capture
from . import folders

MOST_KEPT = 2


@dataclass
class ReadCaptures:
    """The captures that were asked for last, by their paths."""

    by_path: dict[Path, Capture] = field(default_factory=dict)


def path_of(scene: bpy.types.Scene) -> Path:
    """Where the scene's capture lies.

    Raises:
        BadRequest: None was imported.
    """
    if not scene.karf.capture:
        raise BadRequest("The scene {name!r} has no capture.", "Import a capture first.", name=scene.name)
    return folders.absolute(scene.karf.capture)


def of(scene: bpy.types.Scene) -> Capture:
    """The scene's capture, as it was when it was read last.

    Raises:
        KarfError: None was imported, or it cannot be read.
    """
    path, known = path_of(scene), session.get(ReadCaptures).by_path
    if path not in known:
        known[path] = open_capture(path)
        if len(known) > MOST_KEPT:
            del known[next(iter(known))]
    return known[path]


def view_of(scene: bpy.types.Scene, name: str = "") -> View:
    """A captured view by name; an empty name is the active view's."""
    return of(scene).view(name or scene.karf.active_view)


def forget() -> None:
    """Read captures from disk again at the next question."""
    session.get(ReadCaptures).by_path.clear()
