"""Paths of a rig's photos: relative to the .blend where the user prefers it, and found again after a move."""

import re
from collections.abc import Iterator
from pathlib import Path

import bpy

from .. import progress, session
from . import folders


def _photos(scene: bpy.types.Scene) -> Iterator[bpy.types.Image]:
    """Yield the images behind the rig's cameras, and the photo to mark."""
    for camera in scene.karf.rig.children if scene.karf.rig else ():
        if camera.type == "CAMERA":
            yield from (each.image for each in camera.data.background_images if each.image)
    if scene.karf.marking.photo:
        yield scene.karf.marking.photo


def _own_scenes() -> list[bpy.types.Scene]:
    return [scene for scene in bpy.data.scenes if scene.library is None and scene.karf.project]


@session.handler("save_pre", phase=session.Phase.READ)
def _before_save(*_):
    # files of earlier versions have absolute paths; the first save of a file makes all paths relative by itself
    for scene in _own_scenes() if bpy.data.filepath else ():
        for image in _photos(scene):
            if image.filepath and image.library is None and not image.filepath.startswith("//"):
                image.filepath_raw = folders.stored(Path(image.filepath))  # the same file: nothing to read again


@session.handler("load_post", phase=session.Phase.REPORT)
def _after_load(*_):
    for scene in _own_scenes():
        capture = folders.place_of(scene, "capture")
        lost = [] if capture is None or capture.exists() else [capture]
        for image in _photos(scene):
            path = Path(image.filepath)
            if image.library is None and image.filepath[:2] not in ("", "//") and not path.exists():
                found = _found_again(scene, image.filepath)
                if found is None:
                    lost.append(path)
                else:
                    image.filepath = folders.stored(found)
        if lost:
            progress.warn(
                "Photos of the scene {name!r} are missing, such as {path}. Bring them back, or import the capture from "
                "its new place.",
                name=scene.name,
                path=lost[0],
            )


def _found_again(scene: bpy.types.Scene, path: str) -> Path | None:
    """Return the file in the scene's capture or project that an absolute path, perhaps of another system, ends like."""
    parts = re.split(r"[\\/]+", path)
    for start in range(1, len(parts)):
        for name in ("capture", "project"):
            place = folders.place_of(scene, name)
            if place is not None and (found := place.joinpath(*parts[start:])).is_file():
                return found
    return None
