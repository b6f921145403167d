"""Step 5: recolored pictures as files, also by a render farm, and in Blender; cameras as files, and back."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy

from .. import compositor, progress
from ..engine_api import (
    BadRequest,
    FinishedFrames,
    Message,
    choose_views,
    named,
    open_capture,
    read_edit_file,
    render_bundle,
    tokens_of,
    write_cameras,
    write_edit,
)
from ..host import compat
from ..pictures import images, sequences
from ..project import captures, folders
from ..render_engine import photos
from ..render_engine.engine import NAME
from ..rig import cameras
from ..rig.lens import build_animation, file_name, frames_of
from ..swatches import displayed, edits, outputs
from ..swatches.colors import palettes as palettes_of
from ..tasks.runner import Task
from . import requests
from .swatches import save_edit

STANDARD = ("Standard", "Raw")  # view transforms that show sRGB colors as they are
COPIED = "resolution_x resolution_y resolution_percentage pixel_aspect_x pixel_aspect_y fps fps_base".split()


# --- captured views ------------------------------------------------------------------------------------------------
def save_shown(scene: bpy.types.Scene) -> Path:
    """Write the active view as it is shown, a preview of the photo, as PNG without the engine; returns its path."""
    colors, out, view = images.upright(displayed.of(scene).edited()), folders.out_folder(scene), scene.karf.active_view
    edit = edits.current_edit(scene)
    pattern = outputs.pattern_of(scene, outputs.free_look(scene, out, [view], [edit]))
    name = named(pattern, tokens_of(view))
    path = out / f"{name}.png"  # where the engine writes it too
    images.write_png(path, colors)
    FinishedFrames(out).record(name, "preview", [path], outputs.as_read(scene, edit))
    progress.wrote(path.parent)
    return path


def render_view(scene: bpy.types.Scene, size: str | int | None = None) -> Task:
    """Recolor the active view on its photo; `size` as of `render_captured`. The task's result is the picture's path."""
    task = _captured_task(scene, "This View", scene.karf.active_view, size)
    return replace(task, result=lambda: _frames_in(scene, None)[0])


def render_captured(
    scene: bpy.types.Scene,
    views: str = "all",
    out: str | Path | None = None,
    skip_existing: bool | None = None,
    size: str | int | None = None,
) -> Task:
    """Recolor captured views on their photos, in the folder that is the task's result. Choices become the panel's.

    The views are `all`, `train`, `test`, or names and ranges (`0000-0007`) with commas; `skip_existing` keeps pictures
    that would come out the same. The size `photo` is all pixels of the photos, in files of their kind (PNG, TIFF or
    EXR), `learned` what was learned from, and a number the long side in pixels.
    """
    _choose(scene, out, skip_existing)
    return _captured_task(scene, "Captured Views", views, size)


def _choose(scene: bpy.types.Scene, out: str | Path | None, skip_existing: bool | None) -> None:
    if out is not None:
        folders.store(scene, "out", Path(out).absolute())
    if skip_existing is not None:
        scene.karf.skip_existing = skip_existing


def _captured_task(scene: bpy.types.Scene, title: str, views: str, size: str | int | None) -> Task:
    karf, out = scene.karf, folders.out_folder(scene)
    if size is None:
        size = karf.captured_pixels if karf.captured_size == "PIXELS" else karf.captured_size.lower()
    requests.check_palettes(scene)
    names = [view.name for view in choose_views(captures.of(scene), views)[0]]
    look = outputs.free_look(scene, out, names, [edits.current_edit(scene)])
    edit = out / "edits" / f"{look}.json"
    save_edit(scene, edit)
    job = requests.pictures(scene, views, str(edit), out, look, "photo", size)
    return _frames_task(scene, title, job, are_shown=False)  # what is shown previews them, and follows the swatches


def _frames_task(scene: bpy.types.Scene, title: str, job: requests.Job, are_shown: bool) -> Task:
    frames = Path(job[1]["out"]) / job[1]["names"]
    folders.store(scene, "frames", frames)
    folder = outputs.folder_of(frames)

    def present(found: bpy.types.Scene) -> None:
        progress.warn("The pictures are in {folder}.", folder=folder)
        if are_shown:
            show_frames(found, is_wanted=False)

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

    The other options are as of `render_captured`. The task's result is the folder of frame_0001.png and so on.
    """
    _choose(scene, out, skip_existing)
    folder = camera_folder(scene, camera)
    cameras, files = write_sequence(scene, camera, frames, folder)
    views = [view.name for view in open_capture(cameras, photos=False).views]
    made_by = {file: read_edit_file(Path(file), palettes_of(scene)) for file in files}
    look = outputs.free_look(scene, folder, views, [made_by[file] for file in files])
    job = requests.pictures(scene, str(cameras), files, folder, look, "render")
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

    The folder is new or empty (default: `farm/<camera>` in the output folder), `per_task` the frames of a task, and
    `python` that of the farm's machines that has the engine's packages.
    """
    out = Path(out).absolute() if out else _free(folders.out_folder(scene) / "farm" / camera_folder(scene, camera).name)
    with TemporaryDirectory() as folder:
        cameras, files = write_sequence(scene, camera, frames, Path(folder))
        _, options = requests.pictures(scene, str(cameras), files, out, "", "render")
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


# --- frames in Blender ----------------------------------------------------------------------------------------------
def show_frames(scene: bpy.types.Scene, folder: str | Path | None = None, is_wanted: bool = True) -> bpy.types.Image:
    """Show rendered frames (default: the last) in Image Editors; if not `is_wanted`, not over one painted on."""
    files = _frames_in(scene, folder)
    return sequences.show(files, _first_frame(files), is_wanted)


def add_strip(scene: bpy.types.Scene, folder: str | Path | None = None) -> "bpy.types.Strip":
    """Put rendered frames (default: those rendered last) into the scene's sequencer."""
    files = _frames_in(scene, folder)
    warn_of_view_transform(scene)
    return sequences.add_strip(scene, files, _first_frame(files), f"KaRF {files[0].parent.parent.name}")


def use_standard(scene: bpy.types.Scene) -> None:
    """Show colors as pictures store them, by the view transform Standard."""
    scene.view_settings.view_transform = STANDARD[0]


def warn_of_view_transform(scene: bpy.types.Scene) -> None:
    """Warn of a view transform that shows other colors in the compositor and the sequencer than the files have."""
    transform = scene.view_settings.view_transform
    if transform not in STANDARD:
        progress.warn(
            "The view transform {transform} changes colors: press Show Photo Colors to show them unchanged.",
            transform=transform,
        )


def _frames_in(scene: bpy.types.Scene, folder: str | Path | None) -> list[Path]:
    """Return the pictures of a folder (None: those rendered last); of a camera's frames those of its last job alone."""
    frames = Path(folder).absolute() if folder else folders.place_of(scene, "frames")
    if frames is None:
        raise BadRequest("No frames have been rendered yet.", "Render captured views or a camera's frames first.")
    folder = outputs.folder_of(frames)
    if folder == frames:
        files = sequences.files_in(folder)
    else:
        stems = [Path(named(str(frames), tokens_of(view))) for view in _views_of_frames(scene, frames)]
        files = [path for stem in stems if (path := sequences.newest(stem)) is not None]
    if not files:
        raise BadRequest(
            "There are no frames in {folder}.", "Render captured views or a camera's frames first.", folder=folder
        )
    return files


def _views_of_frames(scene: bpy.types.Scene, frames: Path) -> list[str]:
    """Return the names of the views that rendered frames may show."""
    cameras = _cameras_of(frames)
    return scene.karf.views.keys() if cameras is None else [view.name for view in open_capture(cameras, False).views]


def _cameras_of(frames: Path) -> Path | None:
    """Return the camera file of rendered frames; None for captured views."""
    found = (folder / "cameras.json" for folder in frames.parents if folder.parent.name == "cameras")
    return next(filter(Path.is_file, found), None)


def _first_frame(files: list[Path]) -> int:
    """The scene's frame of the first picture: a camera's frame says it, captured views begin with the first."""
    return (sequences.number_of(files[0]) if _cameras_of(files[0]) else None) or 1


# --- render engine -------------------------------------------------------------------------------------------------
def use_engine(scene: bpy.types.Scene, spaces: Iterable["bpy.types.SpaceView3D"] = ()) -> None:
    """Let KaRF render the scene; `spaces` are 3D Views that show it rendered from now on."""
    scene.render.engine = NAME
    for space in spaces:
        space.shading.type = "RENDERED"
        cameras.turn_about(space.region_3d, scene)
    photos.follow()
    warn_of_view_transform(scene)


def put_objects_in(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Render the scene's own objects within the captured one, each hidden where the other is nearer.

    Returns a scene of the objects, rendered by the scene's former engine, or by EEVEE. A second call updates it.
    """
    requests.check_rig(scene)
    name = f"{scene.name} {compositor.OBJECTS}"
    objects = bpy.data.scenes.get(name)
    if objects is None:
        objects = bpy.data.scenes.new(name)
        objects.render.engine = compat.EEVEE if scene.render.engine == NAME else scene.render.engine
    _take_over(scene, objects)
    use_engine(scene)
    for each in (scene, objects):
        each.view_layers[0].use_pass_z = True
    compositor.build_over_scene(scene, objects)
    return objects


def _take_over(scene: bpy.types.Scene, objects: bpy.types.Scene) -> None:
    """Give the scene of the objects what the other one has: all but the capture."""
    objects.camera, objects.world = scene.camera, scene.world
    objects.frame_start, objects.frame_end = scene.frame_start, scene.frame_end
    objects.view_settings.view_transform = scene.view_settings.view_transform
    objects.render.film_transparent = True
    for name in COPIED:
        setattr(objects.render, name, getattr(scene.render, name))
    source, target, rig = scene.collection, objects.collection, scene.karf.rig
    for held in (target.children, target.objects):
        for each in list(held):
            held.unlink(each)
    for collection in source.children:
        if rig.name not in collection.objects:
            target.children.link(collection)
    for item in source.objects:
        if item not in (rig, scene.karf.surface.item):
            target.objects.link(item)
