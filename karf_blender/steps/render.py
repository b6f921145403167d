"""Step 7: recolored pictures as files."""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import bpy

from .. import progress
from ..engine_api import BadRequest, Request, write_cameras, write_edit
from ..pictures import images
from ..project import folders
from ..rig import frames
from ..swatches import edits, planes, recolor
from ..tasks.ownership import Owner
from ..tasks.task import Task
from . import requests, sequences
from .cameras import camera_of
from .edit import save_edit


def render_view(scene: bpy.types.Scene) -> Path:
    """Write the active view as it is shown, without the engine.

    Returns:
        The PNG's path.
    """
    colors = images.upright(planes.composite(scene))
    # where the engine writes this view too
    path = folders.out_folder(scene) / "recolor" / f"{scene.karf.active_view}.png"
    images.write_png(path, colors)
    return path


def render_captured(scene: bpy.types.Scene, views: str = "all") -> Task:
    """Recolor captured views (`all`, `train`, `test` or names) with the swatches as they stand, on their photos."""
    out = folders.out_folder(scene)
    edit = out / "edit.json"
    save_edit(scene, edit)
    return _frames_task(scene, "Render Capture", requests.pictures(scene, views, str(edit), out, "photo"))


def render_camera(scene: bpy.types.Scene, camera: bpy.types.Object | None, numbers: Iterable[int]) -> Task:
    """Recolor what any Blender camera (None: the scene's) sees, frame by frame, swatches keyframed or not.

    The pictures are CAMERA_FOLDER/recolor/frame_0001.png and so on, see `camera_folder`.
    """
    camera = camera_of(scene, camera)
    if not scene.karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    out = camera_folder(scene, camera)
    views, files, known = [], [], {}
    with recolor.batched(scene):
        for view in frames.frames_of(scene, camera, numbers):
            edit = edits.current_edit(scene)
            key = b"".join(colors.tobytes() for colors in edit.colors.values())
            if key not in known:
                known[key] = out / "edits" / f"{view.name}.json"
                write_edit(known[key], edit)
            views.append(view)
            files.append(str(known[key]))
    if not views:
        raise BadRequest("There are no frames to render.", "Give at least one frame.")
    write_cameras(out / "cameras.json", views)
    job = requests.pictures(scene, str(out / "cameras.json"), files, out, "render")
    return _frames_task(scene, "Render Camera", job)


def _frames_task(scene: bpy.types.Scene, title: str, job: tuple[str, dict]) -> Task:
    """A task that shows the frames which it has written."""
    stage, options = job
    owner, folder = Owner.of(scene), Path(options["out"]) / "recolor"
    scene.karf.frames = folders.stored(folder)
    request = Request(stage, folders.project_of(scene).folder, options | requests.threads())
    return Task(title, (request,), partial(_show_frames, owner, folder), owner)


def _show_frames(owner: Owner, folder: Path, request: Request) -> None:
    del request
    scene = owner.find()
    if scene is None:
        progress.warn(f"The scene that asked for this is gone or has another project. The frames are in {folder}.")
    else:
        sequences.show_frames(scene, folder, is_wanted=False)


def camera_folder(scene: bpy.types.Scene, camera: bpy.types.Object | None = None) -> Path:
    """Where a camera's (None: the scene's) frames go, with the cameras and edits they are made from.

    It is a folder of its own, `cameras/<camera>` in the output folder.
    """
    return folders.out_folder(scene) / "cameras" / frames.file_name(camera_of(scene, camera))
