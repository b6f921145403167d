"""Looking through a captured view's camera, and how far its photo is from the sparse points."""

import bpy

from ..engine_api import BadRequest, Capture, ErrorSummary, View
from ..project import captures, folders
from ..rig import cameras, looking, reprojection


def look_through(scene: bpy.types.Scene, name: str = "") -> None:
    """Look through a captured view's camera, with its picture size and its photo free of lens distortion.

    The scene's camera and picture size are put back by `leave_view`.

    Raises:
        KarfError: There is no such view, or its photo cannot be read.
    """
    show_camera(scene, captures.of(scene), captures.view_of(scene, name))


def leave_view(scene: bpy.types.Scene) -> None:
    """Give the scene its own camera and picture back.

    Raises:
        BadRequest: No view is looked through.
    """
    if not scene.karf.looking.is_on:
        raise BadRequest("The scene {name!r} is not looking through a captured view.", "", name=scene.name)
    looking.leave(scene)


def show_camera(scene: bpy.types.Scene, capture: Capture, view: View) -> None:
    """The same for a view of the scene's capture.

    Raises:
        DataError: Its photo cannot be read.
    """
    looking.look_through(scene, view)
    reprojection.remember(scene, capture, view.name)
    cameras.straighten_background(scene, view, folders.project_of(scene).photos_folder)


def reprojection_error(scene: bpy.types.Scene, view: str = "") -> ErrorSummary:
    """Measure how far the sparse points are from where a view (default: the active one) shows them in its photo.

    Returns:
        Count of points, and median and worst distance in pixels.

    Raises:
        DataError: The capture has no sparse points.
    """
    name = captures.view_of(scene, view).name
    return reprojection.check(captures.path_of(scene), captures.of(scene), name).summary
