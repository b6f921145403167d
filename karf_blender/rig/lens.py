"""Blender cameras, also animated ones, as the engine's pinholes and views, and the reverse.

Pinhole: pixels (u right, v down), corners at integers, so that a centered principal point is (width / 2, height / 2).
Blender: lens and sensor width in millimeters, shifts in units of the picture's width, pixel aspect of the scene.
"""

import hashlib
from collections.abc import Iterable, Iterator, Sequence

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import BadRequest, Camera, View, is_file_name
from ..host import rendering

SENSOR_WIDTH = 36.0
ASPECT_TOLERANCE = 1e-4


def set_lens(data: bpy.types.Camera, camera: Camera) -> None:
    """Make a Blender camera project like this pinhole without distortion, in a scene with its picture."""
    data.sensor_fit = "HORIZONTAL"  # AUTO would take the longer side
    data.sensor_width = SENSOR_WIDTH
    data.lens = camera.fx * SENSOR_WIDTH / camera.width
    data.shift_x = (camera.width / 2 - camera.cx) / camera.width
    data.shift_y = (camera.cy - camera.height / 2) * camera.fx / camera.fy / camera.width


def set_picture(scene: bpy.types.Scene, camera: Camera) -> None:
    """Give the scene a pinhole's picture size and pixel aspect."""
    render, aspect = scene.render, camera.fx / camera.fy
    render.resolution_x, render.resolution_y = camera.width, camera.height
    render.resolution_percentage = 100
    # Blender accepts 1 to 200 only
    render.pixel_aspect_x, render.pixel_aspect_y = (1.0, aspect) if aspect >= 1 else (1 / aspect, 1.0)


def pinhole(scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """Return a camera in the capture's world, at the scene's current frame and size. Raises like `pinhole_in`."""
    layer = scene.view_layers[0]  # the context's graph may be another scene's
    layer.update()
    return pinhole_in(layer.depsgraph, scene, camera)


def pinhole_in(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """Return the same from a graph, also on the render thread. Raises BadRequest if not perspective or not rigid."""
    if camera.type != "CAMERA" or camera.data.type != "PERSP":
        raise BadRequest(
            "{name!r} is not a perspective camera.", "Set the camera's type to Perspective.", name=camera.name
        )
    render = scene.render
    width, height = (side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
    evaluated = camera.evaluated_get(depsgraph)
    projection = evaluated.calc_matrix_camera(
        depsgraph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    pose = rigid(np.array(to_capture(depsgraph, scene) @ evaluated.matrix_world), camera.name)
    return pinhole_of(np.array(projection), width, height, pose)


def pinhole_of(projection: np.ndarray, width: int, height: int, camera_to_world: np.ndarray) -> Camera:
    """Return the pinhole of a perspective OpenGL projection matrix [4, 4]."""
    return Camera(
        width=width,
        height=height,
        fx=projection[0, 0] * width / 2,
        fy=projection[1, 1] * height / 2,
        cx=(1 - projection[0, 2]) * width / 2,
        cy=(1 + projection[1, 2]) * height / 2,
        camera_to_world=camera_to_world,
    )


def rigid(matrix: np.ndarray, name: str) -> np.ndarray:
    """Return the pose [4, 4] of a camera without its scale. Raises BadRequest if it is sheared or mirrored."""
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3) or np.linalg.det(axes) < 0:
        raise BadRequest(
            "The camera {name!r} is mirrored or unevenly scaled, or a parent or the rig is.",
            "Apply the scale, or make it the same on all three axes.",
            name=name,
        )
    pose = np.eye(4)
    pose[:3, :3] = axes
    pose[:3, 3] = matrix[:3, 3]
    return pose


def to_capture(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene) -> Matrix:
    """Return the matrix [4, 4] from Blender's world to the capture's."""
    rig = scene.karf.rig
    return rig.evaluated_get(depsgraph).matrix_world.inverted() if rig else Matrix.Identity(4)


def frames_of(scene: bpy.types.Scene, camera: bpy.types.Object, numbers: Iterable[int]) -> Iterator[View]:
    """Yield a camera at each frame as a view frame_0001, ... without a photo. Raises BadRequest, also in a render."""
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
    """Return a camera's name as a file name, with a hash if it is not valid or another camera may get the same."""
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
