"""Blender cameras as the engine's pinholes, and the reverse.

Pinhole: pixels (u right, v down), corners at integers, so that a centered principal point is (width / 2, height / 2).
Blender: lens and sensor width in millimeters, shifts in units of the picture's width, pixel aspect of the scene.
"""

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import BadRequest, Camera

SENSOR_WIDTH = 36.0


# --- to Blender ----------------------------------------------------------------------------------------------------
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


# --- to the engine -------------------------------------------------------------------------------------------------
def pinhole(scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """Return a camera in the capture's world, at the scene's current frame and render size.

    Raises BadRequest if it is not a perspective camera, or is mirrored or unevenly scaled.
    """
    layer = scene.view_layers[0]  # the context's graph may be another scene's
    layer.update()
    return pinhole_in(layer.depsgraph, scene, camera)


def pinhole_in(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene, camera: bpy.types.Object) -> Camera:
    """Return the same from a dependency graph of the scene, also on the render thread; raises like `pinhole`."""
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
    """Return the pose [4, 4] float64 of a camera without its scale.

    Raises BadRequest if the matrix [4, 4] is sheared or mirrored.
    """
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
