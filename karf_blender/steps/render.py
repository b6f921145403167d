"""Step 7: recolored pictures as files, also by a render farm; Blender cameras as files of other programs, and back."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy

from .. import progress
from ..engine_api import BadRequest, Message, open_capture, render_bundle, write_cameras, write_edit
from ..pictures import images
from ..pictures.sequences import files_in
from ..project import folders
from ..rig.lens import build_animation, file_name, frames_of
from ..swatches import displayed, edits
from ..tasks.runner import Task
from . import requests
from .blender_render import show_frames
from .edit import save_edit


# --- captured views ------------------------------------------------------------------------------------------------
def save_shown(scene: bpy.types.Scene) -> Path:
    """Write the active view as it is shown, a preview of the photo, as PNG without the engine; returns its path."""
    colors = images.upright(displayed.of(scene).edited())
    # where the engine writes this view too
    path = folders.out_folder(scene) / "recolor" / f"{scene.karf.active_view}.png"
    images.write_png(path, colors)
    progress.wrote(path.parent)
    return path


def render_view(scene: bpy.types.Scene, size: str | int | None = None) -> Task:
    """Recolor the active view on its photo; `size` as of `render_captured`. The task's result is the picture's path."""
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
    """Recolor captured views on their photos, in the folder that is the task's result. Choices become the panel's.

    Args:
        views: `all`, `train`, `test` or names with commas.
        out: Output folder; default: the panel's.
        skip_existing: Whether to keep pictures that would come out the same; default: the panel's.
        size: `photo`: all pixels of the photos, in files of their kind (PNG, TIFF or EXR); `learned`: what was learned
            from; or the long side in pixels. Default: the panel's.
    """
    _choose(scene, out, skip_existing)
    return _captured_task(scene, "Captured Views", views, size)


def _choose(scene: bpy.types.Scene, out: str | Path | None, skip_existing: bool | None) -> None:
    if out is not None:
        scene.karf.out = folders.stored(Path(out).absolute())
    if skip_existing is not None:
        scene.karf.skip_existing = skip_existing


def _captured_task(scene: bpy.types.Scene, title: str, views: str, size: str | int | None) -> Task:
    karf, out = scene.karf, folders.out_folder(scene)
    if size is None:
        size = karf.captured_pixels if karf.captured_size == "PIXELS" else karf.captured_size.lower()
    save_edit(scene, out / "edit.json")
    job = requests.pictures(scene, views, str(out / "edit.json"), out, "photo", size)
    # what is shown stays: it is a preview of these pictures, and follows the swatches
    return _frames_task(scene, title, job, are_shown=False)


def _frames_task(scene: bpy.types.Scene, title: str, job: requests.Job, are_shown: bool) -> Task:
    folder = Path(job[1]["out"]) / "recolor"
    scene.karf.frames = folders.stored(folder)

    def present(found: bpy.types.Scene) -> None:
        progress.warn("The pictures are in {folder}.", folder=folder)
        if are_shown:
            show_frames(found, folder, is_wanted=False)

    finish = requests.presenting(present, Message("The frames are in {folder}.", folder=folder), folder)
    return requests.task(scene, title, job, finish=finish, result=lambda: folder)


# --- a camera's frames ---------------------------------------------------------------------------------------------
def render_sequence(
    scene: bpy.types.Scene,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    skip_existing: bool | None = None,
) -> Task:
    """Recolor what a camera (default: the scene's) sees in frames (default: the scene's), with the swatches of each.

    `out` and `skip_existing` are as of `render_captured`. The task's result is the folder of the pictures,
    frame_0001.png and so on, in the `camera_folder`.
    """
    _choose(scene, out, skip_existing)
    folder = camera_folder(scene, camera)
    cameras, files = write_sequence(scene, camera, frames, folder)
    job = requests.pictures(scene, str(cameras), files, folder, "render")
    return _frames_task(scene, "Camera's Frames", job, are_shown=True)


def farm_bundle(
    scene: bpy.types.Scene,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
    out: str | Path | None = None,
    per_task: int = 10,
    python: str = "python3",
) -> Path:
    """Write a bundle for a farm that renders what `render_sequence` does, and return its folder; see docs/farm.md.

    Args:
        out: The bundle's folder, new or empty; default: a new one, `farm/<camera>` in the output folder.
        per_task: Frames of a task.
        python: The Python of the farm's machines that has the engine's packages.
    """
    out = Path(out).absolute() if out else _free(folders.out_folder(scene) / "farm" / camera_folder(scene, camera).name)
    with TemporaryDirectory() as folder:
        cameras, files = write_sequence(scene, camera, frames, Path(folder))
        _, options = requests.pictures(scene, str(cameras), files, out, "render")
        pictures = {name: options[name] for name in ("base", "format", "alpha")}
        project = folders.project_of(scene).folder
        return render_bundle(project, out, views=str(cameras), edit=files, per_task=per_task, python=python, **pictures)


def _free(folder: Path) -> Path:
    """The folder, or the next of its name that is not there yet."""
    numbered = (folder.with_name(f"{folder.name}_{number}") for number in count(2))
    return folder if not folder.exists() else next(other for other in numbered if not other.exists())


def write_sequence(
    scene: bpy.types.Scene, camera: bpy.types.Object | None, frames: Iterable[int] | None, out: Path
) -> tuple[Path, list[str]]:
    """Write cameras and swatches of frames; return the camera file and each frame's edit file, equal ones once."""
    camera = camera_of(scene, camera)
    requests.check_palettes(scene)
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


def camera_folder(scene: bpy.types.Scene, camera: bpy.types.Object | None = None) -> Path:
    """The folder of a camera's (None: the scene's) frames, and of the cameras and edits they are made from."""
    return folders.out_folder(scene) / "cameras" / file_name(camera_of(scene, camera))


# --- cameras -------------------------------------------------------------------------------------------------------
def export_cameras(
    scene: bpy.types.Scene,
    path: str | Path,
    camera: bpy.types.Object | None = None,
    frames: Iterable[int] | None = None,
) -> Path:
    """Write a camera in frames, as of `render_sequence`, as a transforms.json relative to the rig; return its path."""
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
    """Return a camera, or the scene's, which must be there."""
    camera = camera or scene.camera
    if camera is None:
        raise BadRequest(
            "The scene {name!r} has no camera.", "Add one, or choose a camera of the capture.", name=scene.name
        )
    return camera


def frame_range(scene: bpy.types.Scene) -> range:
    """The scene's own frames."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
