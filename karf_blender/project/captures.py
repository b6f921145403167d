"""The captures that scenes were made from, read once: large models take seconds."""

from functools import lru_cache
from pathlib import Path

import bpy

from ..engine_api import BadRequest, Capture, View, open_capture
from . import folders


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
    return _read(path_of(scene))


def view_of(scene: bpy.types.Scene, name: str = "") -> View:
    """A captured view by name; an empty name is the active view's."""
    return of(scene).view(name or scene.karf.active_view)


def forget() -> None:
    """Read captures from disk again at the next question."""
    _read.cache_clear()


@lru_cache(maxsize=2)
def _read(path: Path) -> Capture:
    return open_capture(path)
