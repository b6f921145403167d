"""Cameras read from a file as one animated Blender camera."""

from collections.abc import Sequence

import bpy
from mathutils import Matrix

from ..engine_api import BadRequest, Camera, View
from .cameras import set_lens, set_picture

KEYED = ("location", "rotation_quaternion")
KEYED_LENS = ("lens", "shift_x", "shift_y")
ASPECT_TOLERANCE = 1e-4


def frame_numbers(views: Sequence[View], first: int) -> list[int]:
    """The frame of each view: the number at its name's end where all differ in it, else counted from `first`."""
    ends = [view.name[len(view.name.rstrip("0123456789")) :] for view in views]
    numbers = [int(end) for end in ends if end]
    return numbers if len(set(numbers)) == len(views) else list(range(first, first + len(views)))


def build(views: Sequence[View], name: str, scene: bpy.types.Scene) -> bpy.types.Object:
    """One camera below the scene's rig with keyframes for every view; the scene gets its picture size and frame range.

    Raises:
        BadRequest: The views need different pixel aspects, which Blender keeps per scene.
    """
    cameras = _at_one_size(views)
    numbers = frame_numbers(views, scene.frame_start)
    data = bpy.data.cameras.new(name)
    item = bpy.data.objects.new(name, data)
    item.parent = scene.karf.rig
    item.rotation_mode = "QUATERNION"
    before = None
    for number, camera in sorted(zip(numbers, cameras, strict=True), key=lambda pair: pair[0]):
        location, rotation, _ = Matrix(camera.camera_to_world.tolist()).decompose()
        if before is not None:
            rotation.make_compatible(before)
        before = rotation
        item.location, item.rotation_quaternion = location, rotation
        set_lens(data, camera)
        for path in KEYED:
            item.keyframe_insert(path, frame=number)
        for path in KEYED_LENS:
            data.keyframe_insert(path, frame=number)
    scene.collection.objects.link(item)
    scene.camera = item
    scene.frame_start, scene.frame_end = min(numbers), max(numbers)
    set_picture(scene, cameras[0])
    scene.frame_set(scene.frame_start)
    return item


def _at_one_size(views: Sequence[View]) -> list[Camera]:
    """The views' pinholes at the first one's picture size. Raises BadRequest where their pixel aspects then differ."""
    first = views[0].camera
    cameras = [view.camera.without_distortion().scaled(first.width, first.height) for view in views]
    for view, camera in zip(views, cameras, strict=True):
        if abs(camera.fx * first.fy / (camera.fy * first.fx) - 1) > ASPECT_TOLERANCE:
            raise BadRequest(
                "{name!r} and {other!r} have different resolutions or pixel aspects.",
                "Blender keeps these per scene: split the file, and import each part into a separate scene.",
                name=view.name,
                other=views[0].name,
            )
    return cameras
