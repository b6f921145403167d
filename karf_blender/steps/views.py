"""One captured view: its camera, its recolored picture, and what is learned of it."""

import re
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..engine_api import BadRequest, Capture, ErrorSummary, Message, View
from ..host import windows
from ..marking import photo
from ..pictures import editors, photos
from ..project import captures, disk, folders
from ..rig import cameras, reprojection
from ..swatches import displayed, palettes
from ..tasks import photo_copies, queries
from ..tasks.runner import Task
from . import requests

RENDERED = re.compile("[0-9a-f]{16}")  # the name of a folder of what was rendered, see `disk.renderings_folder`


def look_through(scene: bpy.types.Scene, name: str = "") -> None:
    """Look through a captured view's camera, with its picture size and undistorted photo, until `leave_view`."""
    show_camera(scene, captures.of(scene), captures.view_of(scene, name))


def leave_view(scene: bpy.types.Scene) -> None:
    """Give the scene its own camera and picture back."""
    if not scene.karf.looking.is_on:
        raise BadRequest("The scene {name!r} is not looking through a captured view.", "", name=scene.name)
    cameras.leave(scene)


def show_camera(scene: bpy.types.Scene, capture: Capture, view: View) -> None:
    """Look through the camera of a view of the scene's capture; raises KarfError where its photo cannot be read."""
    cameras.look_through(scene, view)
    reprojection.remember(scene, capture, view.name)
    if cameras.lacks_background(scene, view):
        shown = photos.straightened(photo_copies.readable(scene, view), folders.project_of(scene).photos_folder)
        cameras.add_background(scene, view.name, shown)


def reprojection_error(scene: bpy.types.Scene, view: str = "") -> ErrorSummary:
    """Measure the distances in pixels of the sparse points from where a photo (default: the active one) shows them."""
    name = captures.view_of(scene, view).name
    return reprojection.check(captures.path_of(scene), captures.of(scene), name).summary


def show_view(scene: bpy.types.Scene, view: str = "") -> Task:
    """Show a captured view (default: the active one) recolored; return the task that makes it and gives the image."""
    karf = scene.karf
    if view and view not in karf.views:
        raise BadRequest("The capture has no view {view!r}.", "Choose one from the list.", view=view)
    palettes.import_learned(scene)
    requests.check_palettes(scene)
    if view:
        karf.active_view = view
    is_current = disk.is_current(folders.project_of(scene), karf.active_view)
    if is_current:
        requests.show_recolored(scene, is_wanted=True)
    jobs = () if is_current else (requests.render(karf.active_view, planes=True),)
    return requests.task(scene, "Prepare Views", *jobs, result=lambda: scene.karf.result)


def prepare_views(scene: bpy.types.Scene, views: str = "all") -> Task:
    """Prepare captured views (a view's name, `train`, `test` or `all`), so that they show without the engine."""
    return requests.task(scene, "Prepare Views", requests.render(views, planes=True))


def show_masks(scene: bpy.types.Scene) -> None:
    """Draw the objects' masks over the active view, as soon as the engine has made them."""
    bpy.context.window_manager.karf_seeing.show_masks = True
    displayed.of(scene).load_masks()
    _reveal(scene)
    if displayed.of(scene).known_masks() is None:
        view = scene.karf.active_view
        queries.send(scene, "masks", {"view": view}, partial(_take_masks, _rendered_folder(scene).name, view))


def _take_masks(rendered: str, view: str, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    project = folders.project_of(scene)
    for name, file in values["masks"].items():
        target = project.path("seen", rendered, "masks", name, f"{view}.png")  # of when they were requested
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(file, target)
    displayed.of(scene).load_masks()
    if scene.karf.active_view == view:
        _reveal(scene)


def see_view(scene: bpy.types.Scene) -> Task:
    """Render what is learned of the active view, and the masks of its objects."""
    folder = _rendered_folder(scene)
    is_known = folders.project_of(scene).uncertainty_file.is_file()  # earlier versions did not keep it
    job = requests.render(scene.karf.active_view, out=str(folder), size="learned", unsure=is_known)
    where = Message("The engine's renders of the view are in {folder}.", folder=str(folder))
    return requests.task(scene, "Look at View", job, finish=requests.presenting(_reveal, where))


def _rendered_folder(scene: bpy.types.Scene) -> Path:
    """The folder of what is learned now; those of what was learned before are removed."""
    own = disk.renderings_folder(scene)
    if not own.parent.is_symlink() and own.parent.is_dir():
        for folder in own.parent.iterdir():
            if folder != own and RENDERED.fullmatch(folder.name) and not folder.is_symlink():
                shutil.rmtree(folder, ignore_errors=True)
    return own


def _reveal(scene: bpy.types.Scene) -> None:
    """Show the active view, recolored where it is prepared, in the Image Editors."""
    known = displayed.of(scene)
    image = known.recolor() if disk.is_prepared(scene) else known.show_unedited()
    editors.reveal(image, is_wanted=True)
    photo.leave(scene)
    windows.redraw()
