"""Copies of photos that Blender cannot read, which the engine makes once, in the project's folder of photos."""

import shutil

import bpy

from ..engine_api import DataError, View, camera_to_json
from ..pictures import photos
from ..preferences import state
from ..project import folders
from . import queries


def readable(scene: bpy.types.Scene, view: View) -> View:
    """Return the view with a photo that Blender reads, its own or a copy; blocks while the engine makes one.

    Raises KarfError if the photo cannot be read, or needs an engine and there is none.
    """
    folder = folders.project_of(scene).photos_folder
    if found := photos.readable(view, folder):
        return found
    if state.known().problem:
        raise DataError(
            "Blender cannot show {path} without the engine.",
            "Press Install Engine in the KaRF preferences, or export the photos as JPEG.",
            path=view.image,
        )
    copy = photos.copy_for(view, folder)
    answer = queries.wait(scene, "photo", {"photo": str(view.image), "camera": camera_to_json(view.camera)})
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(answer["photo"], copy)
    return photos.readable(view, folder)
