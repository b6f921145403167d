"""The captures of scenes, read once: large models take seconds."""

from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .. import session
from ..engine_api import BadRequest, Capture, View, open_capture
from . import folders

MOST_KEPT = 2


@dataclass
class ReadCaptures:
    per_file = True
    by_path: dict[Path, Capture] = field(default_factory=dict)  # the latest


def path_of(scene: bpy.types.Scene) -> Path:
    """Return the path of the scene's capture; raise BadRequest if none was imported."""
    place = folders.place_of(scene, "capture")
    if place is None:
        raise BadRequest("The scene {name!r} has no capture.", "Import a capture first.", name=scene.name)
    return place


def of(scene: bpy.types.Scene) -> Capture:
    """Return the scene's capture as it was read last; raise KarfError if none was imported or it is unreadable."""
    path, known = path_of(scene), session.get(ReadCaptures).by_path
    if path not in known:
        known[path] = open_capture(path)
        if len(known) > MOST_KEPT:
            del known[next(iter(known))]
    return known[path]


def view_of(scene: bpy.types.Scene, name: str = "") -> View:
    """Return a captured view by name; by default the active view."""
    return of(scene).view(name or scene.karf.active_view)


def left_out(scene: bpy.types.Scene) -> list[str]:
    """Return the names of the views whose photos the user leaves out of learning."""
    return [view.name for view in scene.karf.views if not view.is_learned]


def forget() -> None:
    """Read captures again from disk next time."""
    session.get(ReadCaptures).by_path.clear()
