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
    # the first save of a file makes all paths relative by itself
    for scene in _own_scenes() if bpy.data.filepath else ():
        for image in _photos(scene):
            if _is_absolute(image) and Path(image.filepath).is_absolute():  # not one of another system
                image.filepath_raw = folders.stored(Path(image.filepath))  # the same file: nothing to read again


@session.handler("load_post", phase=session.Phase.REPORT)
def _after_load(*_):
    # earlier versions saved absolute paths
    for scene in _own_scenes():
        capture = folders.place_of(scene, "capture")
        lost = [capture] if capture and not capture.exists() else []
        project = folders.project_of(scene).folder
        places = [capture.parent if capture.is_file() else capture, project] if capture else [project]
        for image in filter(_is_absolute, _photos(scene)):
            found = _own_file(image.filepath, places)
            if found is None and not Path(image.filepath).exists():
                lost.append(image.filepath)
            elif found is not None and (stored := folders.stored(found)) != image.filepath:
                image.filepath = stored
        if lost:
            progress.warn(
                "Photos of the scene {name!r} are missing, such as {path}. Bring them back, or import the capture from "
                "its new place.",
                name=scene.name,
                path=lost[0],
            )


def _is_absolute(image: bpy.types.Image) -> bool:
    return image.library is None and image.filepath[:2] not in ("", "//")


def _own_file(path: str, places: list[Path]) -> Path | None:
    """Return the file in the places that an absolute path, perhaps of another system, is or ends like."""
    if any(place in Path(path).parents for place in places) and Path(path).is_file():
        return Path(path)
    parts = re.split(r"[\\/]+", path)
    ends = (Path(*parts[start:]) for start in range(1, len(parts)))
    return next((place / end for end in ends for place in places if (place / end).is_file()), None)
