"""Step 7: recolored pictures as files."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import bpy

from .. import progress
from ..engine_api import BadRequest, Message, Request, write_cameras, write_edit
from ..pictures import images
from ..pictures.sequences import files_in
from ..project import folders
from ..rig.frames import file_name, frames_of
from ..swatches import displayed, edits
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import requests, sequences
from .cameras import camera_of, frame_range
from .edit import save_edit


def save_shown(scene: bpy.types.Scene) -> Path:
    """Write the active view as it is shown, a preview of the photo, without the engine.

    Returns:
        The PNG's path.
    """
    colors = images.upright(displayed.of(scene).edited())
    # where the engine writes this view too
    path = folders.out_folder(scene) / "recolor" / f"{scene.karf.active_view}.png"
    images.write_png(path, colors)
    progress.wrote(path.parent)
    return path


def render_view(scene: bpy.types.Scene, size: str | int | None = None) -> Task:
    """Recolor the active view with the swatches as they stand, on its photo; `size` as of `render_captured`.

    Returns:
        The task; its result is the picture's path.
    """
    view = scene.karf.active_view
    task = _captured_task(scene, "This View", view, size)
    return replace(task, result=lambda: files_in(task.result(), [view])[0])


def render_captured(
    scene: bpy.types.Scene,
    views: str = "all",
    out: str | Path | None = None,
    skip_existing: bool | None = None,
    size: str | int | None = None,
) -> Task:
    """Recolor captured views with the swatches as they stand, on their photos. What is chosen becomes the panel's.

    Args:
        scene: The scene.
        views: `all`, `train`, `test` or names with commas.
        out: Output folder; default: the panel's.
        skip_existing: Whether to keep pictures that would come out the same; default: the panel's.
        size: `photo`: all pixels of the photos, in files of their kind (PNG, TIFF or EXR); `learned`: what was learned
            from; or the long side in pixels. Default: the panel's.

    Returns:
        The task; its result is the folder of the pictures.
    """
    _choose(scene, out, skip_existing)
    return _captured_task(scene, "Captured Views", views, size)


def _choose(scene: bpy.types.Scene, out: str | Path | None, skip_existing: bool | None) -> None:
    if out is not None:
        scene.karf.out = folders.stored(Path(out).absolute())
    if skip_existing is not None:
        scene.karf.skip_existing = skip_existing


def _captured_task(scene: bpy.types.Scene, title: str, views: str, size: str | int | None) -> Task:
    """What is shown stays: it is a preview of these pictures, and follows the swatches."""
    out = folders.out_folder(scene)
    edit = out / "edit.json"
    save_edit(scene, edit)
    job = requests.pictures(scene, views, str(edit), out, "photo", _captured_size(scene) if size is None else size)
    return _frames_task(scene, title, job, are_shown=False)


def _captured_size(scene: bpy.types.Scene) -> str | int:
    """The panel's size of captured views, as the engine takes it."""
    karf = scene.karf
    return karf.captured_pixels if karf.captured_size == "PIXELS" else karf.captured_size.lower()


def render_sequence(
    scene: bpy.types.Scene,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    skip_existing: bool | None = None,
) -> Task:
    """Recolor what any Blender camera sees, frame by frame, with the swatches of each. What is chosen becomes the panel's.

    Args:
        scene: The scene.
        camera: Default: the scene's.
        frames: Their numbers; default: the scene's range.
        out: Output folder; default: the panel's.
        skip_existing: Whether to keep frames that would come out the same; default: the panel's.

    Returns:
        The task; its result is the folder of the pictures, frame_0001.png and so on, in the `camera_folder`.
    """
    _choose(scene, out, skip_existing)
    folder = camera_folder(scene, camera)
    cameras, files = write_sequence(scene, camera, frames, folder)
    job = requests.pictures(scene, str(cameras), files, folder, "render")
    return _frames_task(scene, "Camera's Frames", job, are_shown=True)


def write_sequence(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, frames: Iterable[int] | None, out: Path
) -> tuple[Path, list[str]]:
    """Write what a camera (None: the scene's) is in these frames (None: the scene's), and the swatches there.

    Equal edits are one file.

    Returns:
        The camera file, and the edit's file of each frame.

    Raises:
        BadRequest: There is no camera, palette or frame.
    """
    camera = camera_of(scene, camera)
    if not scene.karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    views, files, known = [], [], {}
    with displayed.batched(scene):
        for view in frames_of(scene, camera, frame_range(scene) if frames is None else frames):
            edit = edits.current_edit(scene)
            key = b"".join([repr(edit.edges).encode(), *(colors.tobytes() for colors in edit.colors.values())])
            if key not in known:
                known[key] = out / "edits" / f"{view.name}.json"
                write_edit(known[key], edit)
            views.append(view)
            files.append(str(known[key]))
    if not views:
        raise BadRequest("There are no frames to render.", "Give at least one frame.")
    write_cameras(out / "cameras.json", views)
    return out / "cameras.json", files


def _frames_task(scene: bpy.types.Scene, title: str, job: tuple[str, dict], are_shown: bool) -> Task:
    """A task that says where the pictures are which it has written, and shows them or not."""
    _, options = job
    folder = Path(options["out"]) / "recolor"
    scene.karf.frames = folders.stored(folder)
    finish = partial(_present_frames, folder, are_shown)
    return requests.task(scene, title, job, finish=finish, result=lambda: folder)


def _present_frames(folder: Path, are_shown: bool, owner: Owner, request: Request) -> None:
    del request
    progress.wrote(folder)
    scene = requests.find_scene(owner, Message("The frames are in {folder}.", folder=folder))
    if scene is None:
        return
    progress.warn(Message("The pictures are in {folder}.", folder=folder))
    if are_shown:
        sequences.show_frames(scene, folder, is_wanted=False)


def camera_folder(scene: bpy.types.Scene, camera: bpy.types.Object | None = None) -> Path:
    """Where a camera's (None: the scene's) frames go, with the cameras and edits they are made from.

    It is a folder of its own, `cameras/<camera>` in the output folder.
    """
    return folders.out_folder(scene) / "cameras" / file_name(camera_of(scene, camera))
