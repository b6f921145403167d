"""Looking at what is learned of the active view: the objects' masks over it, and the field's own rendering."""

import re
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..engine_api import Message, Request
from ..marking import asking
from ..pictures import editors
from ..project import contents, folders
from ..swatches import displayed, drawn_over
from ..tasks import queries
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import requests

MARK = re.compile("[0-9a-f]{16}")  # the name of a folder of what was rendered, see `contents.seen_folder`


def show_masks(scene: bpy.types.Scene) -> None:
    """Draw the objects' masks over the active view; where it is neither prepared nor was looked at, as soon as they come.

    Raises:
        KarfError: There is no project, or the engine cannot be started.
    """
    bpy.context.window_manager.karf_seeing.show_masks = True
    displayed.of(scene).load_masks()
    _reveal(scene)
    if displayed.of(scene).known_masks() is None:
        view = scene.karf.active_view
        queries.send(scene, "masks", {"view": view}, partial(_take_masks, _fresh_folder(scene).name, view))


def _take_masks(mark: str, view: str, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    project = folders.project_of(scene)
    for name, file in values["masks"].items():
        target = project.path(
            "seen", mark, "masks", name, f"{view}.png"
        )  # of what was learned when they were asked for
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(file, target)
    displayed.of(scene).load_masks()
    if scene.karf.active_view == view:
        _reveal(scene)


def see_view(scene: bpy.types.Scene) -> Task:
    """The task that renders what is learned of the active view, and the masks of its objects."""
    job = requests.seen(scene, _fresh_folder(scene))
    return requests.task(scene, "Look at View", job, finish=_present)


def _fresh_folder(scene: bpy.types.Scene) -> Path:
    """The folder of what is learned now, once those of what was learned before are removed."""
    own = contents.seen_folder(scene)
    if not own.parent.is_symlink() and own.parent.is_dir():
        for folder in own.parent.iterdir():
            if folder != own and MARK.fullmatch(folder.name) and not folder.is_symlink():
                shutil.rmtree(folder, ignore_errors=True)
    return own


def _present(owner: Owner, request: Request) -> None:
    scene = requests.find_scene(
        owner, Message("The engine's renders of the view are in {folder}.", folder=request.options["out"])
    )
    if scene is not None:
        _reveal(scene)


def _reveal(scene: bpy.types.Scene) -> None:
    """Show the active view, recolored where it is prepared, in the Image Editors."""
    known = displayed.of(scene)
    image = known.recolor() if contents.is_prepared(scene) else known.show_unedited()
    editors.reveal(image, is_wanted=True)
    asking.leave_photo(scene)
    drawn_over.redraw()
