"""Blender cameras as files for other programs, and back."""

from collections.abc import Iterable
from pathlib import Path

import bpy

from ..engine_api import BadRequest, open_capture, write_cameras
from ..rig.frames import build_animation, frames_of


def export_cameras(
    scene: bpy.types.Scene,
    path: str | Path,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
) -> Path:
    """Write what a camera is frame by frame as a transforms.json, with poses relative to the rig where there is one.

    Args:
        scene: The scene.
        path: The file.
        camera: Default: the scene's.
        frames: Their numbers; default: the scene's range.

    Returns:
        The file's path.

    Raises:
        BadRequest: There is no camera or no frame, or the camera is not a pinhole.
    """
    path, numbers = Path(path).absolute(), frame_range(scene) if frames is None else frames
    views = list(frames_of(scene, camera_of(scene, camera), numbers))
    if not views:
        raise BadRequest("There are no frames to export.", "Give at least one frame.")
    write_cameras(path, views)
    return path


def import_cameras(scene: bpy.types.Scene, path: str | Path) -> bpy.types.Object:
    """Make one animated camera, below the rig where there is one, of the cameras in a file; it becomes the scene's."""
    path = Path(path).absolute()
    return build_animation(open_capture(path, photos=False).views, path.stem, scene)


def camera_of(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> bpy.types.Object:
    """A camera, or the scene's.

    Raises:
        BadRequest: There is none.
    """
    camera = camera or scene.camera
    if camera is None:
        raise BadRequest(
            "The scene {name!r} has no camera.", "Add one, or choose a camera of the capture.", name=scene.name
        )
    return camera


def frame_range(scene: bpy.types.Scene) -> range:
    """The scene's own frames."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
