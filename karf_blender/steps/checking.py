"""Step 1: the capture looked at by the engine before it is learned, and the map of what to shoot more."""

import shutil
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..engine_api import KarfError, Message
from ..host import windows
from ..host.words import kept
from ..pictures import editors
from ..preferences import state
from ..project import captures, contents, folders
from ..tasks import queries

KIND = "inspect"
MAP_NAME = f"{editors.PREFIX} more photos"


def check_capture(scene: bpy.types.Scene, shows_map: bool = True) -> None:
    """Ask the engine how good the scene's capture is; what it answers stands in steps 1 and 2.

    Args:
        scene: The scene.
        shows_map: Whether the Image Editors then show where more photos would help.

    Raises:
        KarfError: No capture was imported, or the engine cannot be started.
    """
    options = {
        "capture": str(captures.path_of(scene)),
        "holdout": max(0, scene.karf.holdout),
        "masks": _masks(scene),
    }
    queries.send(scene, KIND, options, partial(_take_answer, shows_map))


def check_unasked(scene: bpy.types.Scene) -> None:
    """Check a capture that was just imported, where an engine is there and nothing is learned of it yet. Never raises."""
    is_wanted = not (state.known().problem or contents.finished_stages(scene) or scene.karf.advice)
    if bpy.app.background or not is_wanted:
        return
    try:
        check_capture(scene, shows_map=False)
    except (KarfError, OSError) as error:
        print(f"KaRF: {error}")


def _masks(scene: bpy.types.Scene) -> str | None:
    folder = folders.absolute(scene.karf.masks) if scene.karf.masks else None
    return str(folder) if folder is not None and folder.is_dir() else None


def _take_answer(shows_map: bool, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    messages = [Message.from_json(each) for each in values["advice"]]
    scene.karf.advice = "\n".join(map(kept, messages))
    scene.karf.is_poor = values["is_poor"]
    path = folders.project_of(scene).path("inspection", "more_photos.png")
    path.parent.mkdir(exist_ok=True)
    shutil.move(values["picture"], path)
    if shows_map:
        _show_map(path)
    windows.redraw(*windows.PANEL_AREAS)


def _show_map(path: Path) -> None:
    image = bpy.data.images.get(MAP_NAME)
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = MAP_NAME
    image.filepath = str(path)
    image.reload()
    editors.reveal(image, is_wanted=True, is_whole=True)
