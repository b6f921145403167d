"""Animated Blender cameras as views of the engine, frame by frame, and the reverse."""

import hashlib
from collections.abc import Iterable, Iterator, Sequence

import bpy
from mathutils import Matrix

from ..engine_api import BadRequest, Camera, View, is_file_name
from ..host import rendering
from .lens import pinhole, set_lens, set_picture

ASPECT_TOLERANCE = 1e-4


def frames_of(scene: bpy.types.Scene, camera: bpy.types.Object, numbers: Iterable[int]) -> Iterator[View]:
    """Yield a camera at each frame as a view frame_0001, ... without a photo.

    The scene is at that frame meanwhile, and back at its current frame at the end.
    Raises BadRequest if it is not a perspective camera, or Blender is rendering.
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
    """Return a camera's name as the name of a file or folder, unique in the .blend.

    A hash is appended if some system refuses the name, or if another camera differs from it by case or such signs only.
    """
    clean = bpy.path.clean_name(camera.name)
    others = [other for other in bpy.data.objects if other.type == "CAMERA" and other != camera]
    taken = {bpy.path.clean_name(other.name).casefold() for other in others}
    if clean == camera.name and is_file_name(clean) and clean.casefold() not in taken:
        return clean
    return f"{clean}-{hashlib.sha256(camera.name.encode()).hexdigest()[:8]}"


def build_animation(views: Sequence[View], name: str, scene: bpy.types.Scene) -> bpy.types.Object:
    """Make one camera below the scene's rig with keyframes for every view; the scene gets its picture and frame range.

    Frames are the numbers at the ends of the views' names if all differ, else they are counted from the scene's first.
    Raises BadRequest if pixel aspects differ.
    """
    cameras = _at_one_size(views)
    ends = [view.name[len(view.name.rstrip("0123456789")) :] for view in views]
    numbers = [int(end) for end in ends if end]
    if len(set(numbers)) != len(views):
        numbers = list(range(scene.frame_start, scene.frame_start + len(views)))
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
        for owner, paths in ((item, ("location", "rotation_quaternion")), (data, ("lens", "shift_x", "shift_y"))):
            for path in paths:
                owner.keyframe_insert(path, frame=number)
    scene.collection.objects.link(item)
    scene.camera = item
    scene.frame_start, scene.frame_end = min(numbers), max(numbers)
    set_picture(scene, cameras[0])
    scene.frame_set(scene.frame_start)
    return item


def _at_one_size(views: Sequence[View]) -> list[Camera]:
    """Return the views' pinholes at the first one's picture size; raise BadRequest if their pixel aspects differ."""
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
