"""Steps 2, 4 and 5: what the engine learns; and showing a view of it."""

from collections.abc import Sequence
from pathlib import Path

import bpy

from ..engine_api import BadRequest
from ..pictures import editors
from ..project import captures, contents, folders
from ..swatches import palettes, recolor
from ..tasks.task import Task
from . import requests


def learn_scene(scene: bpy.types.Scene, preset: str = "", overrides: Sequence[str] = ()) -> Task:
    """Geometry from the photos, or of the panel's pretrained NeRF; a preset becomes the panel's, an empty one is it."""
    return requests.task(scene, "Learn Scene", _geometry(scene, preset, overrides))


def learn_all(scene: bpy.types.Scene, preset: str = "", overrides: Sequence[str] = ()) -> Task:
    """All that is learned, in a row, and the planes of the active view; what is done already is not learned again.

    Raises:
        BadRequest: No masks are chosen.
    """
    jobs = (_geometry(scene, preset, overrides), _segmentation(scene, None), *_palettes(scene))
    return requests.task(scene, "Learn All", *jobs)


def _geometry(scene: bpy.types.Scene, preset: str, overrides: Sequence[str]) -> tuple[str, dict]:
    scene.karf.preset = preset or scene.karf.preset
    return "geometry", {
        "capture": str(captures.path_of(scene)),
        "preset": scene.karf.preset,
        "overrides": list(overrides),
        "nerf": folders.nerf_of(scene) or None,
        "holdout": scene.karf.holdout if scene.karf.holdout >= 0 else None,
        "masks": str(folders.absolute(scene.karf.masks)) if scene.karf.masks else None,
    }


def segment(scene: bpy.types.Scene, folder: Path | None = None) -> Task:
    """Masks of every view from the coarse ones in a folder (default: the panel's).

    Raises:
        BadRequest: No folder is chosen.
    """
    return requests.task(scene, "Segment", _segmentation(scene, folder))


def _segmentation(scene: bpy.types.Scene, folder: Path | None) -> tuple[str, dict]:
    if folder is None and not scene.karf.masks:
        raise BadRequest("No masks are chosen.", "Give a folder with <object>/<photo name>.png, or paint one.")
    folder = folder or folders.absolute(scene.karf.masks)
    scene.karf.masks = folders.stored(folder)
    return "segmentation", {"masks": str(folder)}


def extract_palette(scene: bpy.types.Scene) -> Task:
    """Palettes of the objects, what every pixel takes from them, and the planes of the active view."""
    return requests.task(scene, "Extract Palette", *_palettes(scene))


def _palettes(scene: bpy.types.Scene) -> tuple[tuple[str, dict], ...]:
    return ("palette", {}), ("recoloring", {}), requests.planes(scene.karf.active_view)


def prepare_views(scene: bpy.types.Scene, views: str) -> Task:
    """Edit planes of captured views, so that they can be shown: a view's name, `train`, `test` or `all`."""
    return requests.task(scene, "Prepare Views", requests.planes(views))


def show_view(scene: bpy.types.Scene, name: str = "") -> Task | None:
    """Make a captured view active and show it, where it has planes.

    Palettes that the project has learned meanwhile are imported first.

    Returns:
        None, or the task that prepares the view where it has no planes.

    Raises:
        KarfError: There is no such view, there are no palettes, or Blender renders.
    """
    karf = scene.karf
    if name and name not in karf.views:
        raise BadRequest(f"The capture has no view {name!r}.", "Choose one from the list.")
    palettes.import_learned(scene)
    if not karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    if name:
        karf.active_view = name
    if not contents.is_current(folders.project_of(scene), karf.active_view):
        return prepare_views(scene, karf.active_view)
    editors.reveal(recolor.show(scene), is_wanted=True, is_whole=True)
    return None
