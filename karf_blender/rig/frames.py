"""Blender cameras as cameras of the engine: pinholes in the capture's world, frame by frame."""

import hashlib
from collections.abc import Iterable, Iterator

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import BadRequest, Camera, View, is_file_name
from ..host import rendering
from . import lens


def frames_of(scene: bpy.types.Scene, camera: bpy.types.Object, numbers: Iterable[int]) -> Iterator[View]:
    """The camera as the engine sees it, frame by frame.

    Args:
        scene: It is at the frame when that is yielded; its current frame is restored at the end.
        camera: A perspective camera.
        numbers: The frames.

    Yields:
        Views without photos, named frame_0001 and so on.

    Raises:
        BadRequest: The camera is not a perspective camera, or Blender renders.
    """
    rendering.refuse()
    current = scene.frame_current
    try:
        for number in numbers:
            scene.frame_set(number)
            name = f"frame_{number:04d}"
            yield View(name, name, pinhole(scene, camera), None, "test")
    finally:
        scene.frame_set(current)


def file_name(camera: bpy.types.Object) -> str:
    """A camera's name as the name of a file or folder, another one for every camera of the file.

    It is the camera's own where that may be one; a camera that differs from another by such signs or by case alone, or
    that has a name no system takes, has a hash added.
    """
    clean = bpy.path.clean_name(camera.name)
    others = [other for other in bpy.data.objects if other.type == "CAMERA" and other != camera]
    taken = {bpy.path.clean_name(other.name).casefold() for other in others}
    if clean == camera.name and is_file_name(clean) and clean.casefold() not in taken:
        return clean
    return f"{clean}-{hashlib.sha256(camera.name.encode()).hexdigest()[:8]}"


def pinhole(scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """The pinhole, in the capture's world, of a Blender camera with the scene's render size at its current frame.

    Raises:
        BadRequest: The camera is not a perspective camera, or it is mirrored or unevenly scaled.
    """
    # the context's graph may be another scene's
    layer = scene.view_layers[0]
    layer.update()
    return pinhole_in(layer.depsgraph, scene, camera)


def pinhole_in(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """The same as a dependency graph of the scene has evaluated it; for the render thread too.

    Raises:
        BadRequest: As for `pinhole`.
    """
    if camera.type != "CAMERA" or camera.data.type != "PERSP":
        raise BadRequest(
            "{name!r} is not a perspective camera.", "Set the camera's type to Perspective.", name=camera.name
        )
    render = scene.render
    width, height = picture_size(scene)
    evaluated = camera.evaluated_get(depsgraph)
    projection = evaluated.calc_matrix_camera(
        depsgraph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    pose = lens.rigid(np.array(to_capture(depsgraph, scene) @ evaluated.matrix_world), camera.name)
    return lens.pinhole_of(np.array(projection), width, height, pose)


def picture_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height of what the scene renders, in pixels, rounded as Blender does."""
    render = scene.render
    return tuple(side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))


def to_capture(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene) -> Matrix:
    """From Blender's world to the capture's, [4, 4]."""
    rig = scene.karf.rig
    return rig.evaluated_get(depsgraph).matrix_world.inverted() if rig else Matrix.Identity(4)
