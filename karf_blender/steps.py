"""The steps from capture to picture as plain functions; operators and scripts call these.

A step that needs the engine returns a `Task`: launch it beside the interface or wait for it (see `job_watch`). A step
that numpy does at once does it. All raise KarfError for what a user can mend.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from . import (
    camera_paths,
    captures,
    folders,
    job_watch,
    masks,
    pictures,
    preferences,
    recolor,
    reprojection,
    rig,
    swatches,
)
from .engine_api import (
    BadRequest,
    Capture,
    DataError,
    Edit,
    ErrorSummary,
    KarfError,
    Project,
    Request,
    View,
    match_becomes,
    match_fewest,
    nearest_weights,
    open_capture,
    read_edit,
    read_object_colors,
    read_palettes,
    write_cameras,
    write_edit,
)
from .job_watch import Task
from .ownership import Owner


# --- 1 import ------------------------------------------------------------------------------------------------------
def import_capture(
    scene: bpy.types.Scene, path: Path, project: Path | None = None, options: rig.Options | None = None
) -> Capture:
    """Build the rig of a capture and make it the scene's. The capture's remarks say what could not be had.

    project: default the one the scene has of this capture, else a folder beside the .blend. Palettes of another capture
    leave the scene; their edits are kept in the project that they were made in.
    """
    captures.forget()
    capture = open_capture(path)
    path = _place_of(path, capture)
    karf = scene.karf
    is_known = bool(karf.project) and karf.capture == folders.stored(path)
    if project is None:
        project = folders.project_of(scene).folder if is_known else folders.default_project(path)
    try:  # from here on a project that is not there is missing
        project.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        capture = replace(capture, remarks=(*capture.remarks, f"{project} cannot be made: {error.strerror}."))
    karf.rig = rig.build(capture, f"KaRF {project.name}", scene, options)
    with recolor.held(scene):
        if not is_known:
            swatches.load_palettes(scene, ())
        karf.capture = folders.stored(path)
        karf.project = folders.stored(project)
        karf.n_points = 0 if capture.points is None else len(capture.points)
        karf.views.clear()
        for view in capture.views:
            item = karf.views.add()
            item.name, item.split = view.name, view.split
        # a view that learns: masks are painted on it
        first = next(iter(capture.split("train")), capture.views[0])
        karf.active_view = first.name
    try:
        _look_through(scene, capture, first)
    except DataError as error:  # the rig stands; one photo is no reason to take it away
        capture = replace(capture, remarks=(*capture.remarks, error.sentence))
    return capture


def _place_of(path: Path, capture: Capture) -> Path:
    """The folder of the camera file, or that of camera file and photos, where it is the same capture: chosen in whichever
    way, a capture has one path and one project."""
    images = [view.image for view in capture.views]
    start = path.parent if path.is_file() else path
    for folder in (_common_folder([start, *(image.parent for image in images if image)]), start):
        if folder == path:
            break
        try:
            found = open_capture(folder)
        except KarfError:
            continue
        if found.format == capture.format and [view.image for view in found.views] == images:
            return folder
    return path


def _common_folder(places: list[Path]) -> Path:
    try:
        return Path(os.path.commonpath(places))
    except ValueError:  # several drives
        return places[0]


def find_poses(scene: bpy.types.Scene, photos: Path, options: rig.Options | None = None) -> Task:
    """Camera poses of a folder of photos, or of a video, in a new project folder; then their capture is imported."""
    wanted = project = folders.default_project(photos.with_suffix("") if photos.is_file() else photos)
    number = 2
    while (project / "capture").exists():  # found before: what was learned of it stays
        project, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
    out, owner = project / "capture", Owner.of(scene)

    def take_over(request: Request) -> None:
        found = owner.find()
        if found is None:
            job_watch.warn(
                f"The scene that asked for camera poses is gone or has another project: import {out} yourself."
            )
        else:
            import_capture(found, out, project, options)

    request = Request("poses", project, {"photos": str(photos), "out": str(out)} | _threads())
    return Task("Find Camera Poses", (request,), take_over, owner)


def look_through(scene: bpy.types.Scene, name: str = "") -> None:
    """Look through a captured view's camera, with its picture size and its photo free of lens distortion.

    Raises KarfError where there is no such view or its photo cannot be read.
    """
    _look_through(scene, captures.of(scene), captures.view_of(scene, name))


def _look_through(scene: bpy.types.Scene, capture: Capture, view: View) -> None:
    rig.look_through(scene, view)
    reprojection.note(scene, capture, view.name)
    rig.straighten_background(scene, view, folders.project_of(scene).photos_folder)


def reprojection_error(scene: bpy.types.Scene, name: str = "") -> ErrorSummary:
    """How far the sparse points are from where a view's photo shows them. Raises DataError where there are none."""
    name = captures.view_of(scene, name).name
    return reprojection.check(captures.path_of(scene), captures.of(scene), name).summary


# --- 2 learn, 4 segment, 5 palette ---------------------------------------------------------------------------------
def learn_scene(scene: bpy.types.Scene, preset: str = "", overrides: Sequence[str] = ()) -> Task:
    """Geometry from the photos, or of the panel's pretrained NeRF; an empty preset is the panel's."""
    options = {
        "capture": str(captures.path_of(scene)),
        "preset": preset or scene.karf.preset,
        "overrides": list(overrides),
        "nerf": str(folders.absolute(scene.karf.nerf)) if scene.karf.nerf else None,
    }
    return _task(scene, "Learn Scene", ("geometry", options))


def segment(scene: bpy.types.Scene, folder: Path | None = None) -> Task:
    """Masks of every view from the coarse ones in a folder (default: the panel's). Raises BadRequest where it has none."""
    if folder is None and not scene.karf.masks:
        raise BadRequest("No masks are chosen.", "Give a folder with <object>/<photo name>.png, or paint one.")
    folder = folder or folders.absolute(scene.karf.masks)
    scene.karf.masks = folders.stored(folder)
    return _task(scene, "Segment", ("segmentation", {"masks": str(folder)}))


def extract_palette(scene: bpy.types.Scene) -> Task:
    """Palettes of the objects, what every pixel takes from them, and the planes of the active view."""
    return _task(scene, "Extract Palette", ("palette", {}), ("recoloring", {}), _planes(scene.karf.active_view))


def prepare_views(scene: bpy.types.Scene, views: str) -> Task:
    """Edit planes of captured views, so that they can be shown: a view's name, `train`, `test` or `all`."""
    return _task(scene, "Prepare Views", _planes(views))


def _planes(views: str) -> tuple[str, dict]:
    return "render", {"views": views, "edit": None, "out": None, "planes": True, "depth": False, "base": "photo"}


def _task(scene: bpy.types.Scene, title: str, *jobs: tuple[str, dict]) -> Task:
    project, owner = folders.project_of(scene).folder, Owner.of(scene)
    requests = tuple(Request(stage, project, options | _threads()) for stage, options in jobs)
    return Task(title, requests, partial(finished, owner), owner)


def _threads() -> dict[str, int]:
    threads = preferences.current().threads
    return {"threads": threads} if threads else {}


def finished(owner: Owner, request: Request) -> None:
    """Take over what a job has learned into the scenes of its project in the file that began it; else say where it is."""
    brings_planes = request.stage == "render" and request.options["planes"]
    if request.stage != "recoloring" and not brings_planes:
        return
    scenes = list(owner.scenes())
    if not scenes:
        job_watch.warn(
            f"The scene that asked for this is gone or has another project. The result is in {request.project}; choose "
            "that as the project to bring it in."
        )
    for scene in scenes:
        if request.stage == "recoloring":
            recolor.forget()
            swatches.load_palettes(scene, read_palettes(Project(request.project).palette_file))
        elif recolor.is_prepared(scene):
            pictures.reveal(recolor.show(scene))


# --- 5 show --------------------------------------------------------------------------------------------------------
def show_view(scene: bpy.types.Scene, name: str = "") -> Task | None:
    """Make a captured view active and show it at once, or return the task that prepares it where it has no planes.

    Palettes that the project has learned meanwhile are taken over first.
    """
    karf = scene.karf
    if name and name not in karf.views:
        raise BadRequest(f"The capture has no view {name!r}.", "Choose one from the list.")
    swatches.take_over(scene)
    if not karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    if name:
        karf.active_view = name
    if not recolor.is_current(folders.project_of(scene), karf.active_view):
        return prepare_views(scene, karf.active_view)
    pictures.reveal(recolor.show(scene), is_wanted=True)
    return None


# --- 3 mark --------------------------------------------------------------------------------------------------------
def paint_mask(scene: bpy.types.Scene, name: str) -> bpy.types.Image:
    """Begin a coarse mask of object `name` on the active view's photo; returns the image to paint on."""
    return masks.start(scene, name, captures.view_of(scene))


def save_mask(scene: bpy.types.Scene) -> tuple[str, float]:
    """Write the painted mask; returns its file and the painted share of the picture."""
    return masks.save(scene, captures.view_of(scene, scene.karf.mask_view))


# --- 6 edit --------------------------------------------------------------------------------------------------------
def becomes(scene: bpy.types.Scene, name: str, source: Sequence[float], target: Sequence[float], rule: str) -> None:
    """Set an object's swatches so that a color of it becomes another; rule `becomes` or `fewest`. sRGB in [0, 1]."""
    item = swatches.object_named(scene, name)
    project = folders.project_of(scene)
    colors, counts, palette_weights = read_object_colors(project.checked(project.object_colors_file), name)
    palette = recolor.learned_colors(item)
    locked = [index for index, swatch in enumerate(item.swatches) if swatch.locked]
    source, target = np.asarray(source, np.float32), np.asarray(target, np.float32)
    if rule == "fewest":
        weights = nearest_weights(colors, palette_weights, source)
        edited = match_fewest(weights, palette, target, locked, shown=source)
    else:
        edited = match_becomes(colors, counts, palette_weights, palette, source, target, locked)
    kept = recolor.edited_colors(item)
    edited[locked] = kept[locked]
    swatches.apply_edit(scene, Edit({name: edited}, scene.karf.compositing))


def load_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Set the swatches to an edit file; what it does not name becomes as learned."""
    swatches.apply_edit(scene, read_edit(path, swatches.learned(scene)))


def save_edit(scene: bpy.types.Scene, path: Path) -> None:
    """Write the swatches as an edit file."""
    write_edit(path, swatches.current_edit(scene))


# --- 7 render ------------------------------------------------------------------------------------------------------
def render_view(scene: bpy.types.Scene) -> Path:
    """Write the active view as it is shown, without the engine; returns the PNG."""
    colors = recolor.composite(scene)
    # where the engine writes this view too
    path = folders.out_folder(scene) / "recolor" / f"{scene.karf.active_view}.png"
    pictures.write_png(path, colors)
    return path


def render_captured(scene: bpy.types.Scene, views: str = "all") -> Task:
    """Recolor captured views (`all`, `train`, `test` or names) with the swatches as they stand, on their photos."""
    out = folders.out_folder(scene)
    edit = out / "edit.json"
    save_edit(scene, edit)
    return _task(scene, "Render Capture", _pictures(views, str(edit), out, "photo"))


def render_camera(scene: bpy.types.Scene, camera: bpy.types.Object | None, numbers: Iterable[int]) -> Task:
    """Recolor what any Blender camera (None: the scene's) sees, frame by frame, swatches keyframed or not.

    The pictures are CAMERA_FOLDER/recolor/frame_0001.png and so on, see `camera_folder`.
    """
    camera = _camera_of(scene, camera)
    if not scene.karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    out = camera_folder(scene, camera)
    views, files, known = [], [], {}
    with recolor.held(scene):
        for view in rig.frames_of(scene, camera, numbers):
            edit = swatches.current_edit(scene)
            key = b"".join(colors.tobytes() for colors in edit.colors.values())
            if key not in known:
                known[key] = out / "edits" / f"{view.name}.json"
                write_edit(known[key], edit)
            views.append(view)
            files.append(str(known[key]))
    if not views:
        raise BadRequest("There are no frames to render.", "Give at least one frame.")
    write_cameras(out / "cameras.json", views)
    return _task(scene, "Render Camera", _pictures(str(out / "cameras.json"), files, out, "render"))


def camera_folder(scene: bpy.types.Scene, camera: bpy.types.Object | None = None) -> Path:
    """Where a camera's (None: the scene's) frames go, with the cameras and edits they are made from: a folder of its own,
    `cameras/<camera>` in the output folder."""
    return folders.out_folder(scene) / "cameras" / rig.file_name(_camera_of(scene, camera))


def export_cameras(scene: bpy.types.Scene, path: Path, camera: bpy.types.Object | None, numbers: Iterable[int]) -> int:
    """Write what a camera (None: the scene's) is in these frames as a transforms.json; returns their number.

    Poses are relative to the rig's Empty, where there is one. Raises BadRequest for a camera without a pinhole.
    """
    views = list(rig.frames_of(scene, _camera_of(scene, camera), numbers))
    if not views:
        raise BadRequest("There are no frames to export.", "Give at least one frame.")
    write_cameras(path, views)
    return len(views)


def import_cameras(scene: bpy.types.Scene, path: Path) -> bpy.types.Object:
    """One animated camera, below the rig where there is one, of the cameras in a file; it becomes the scene's."""
    return camera_paths.build(open_capture(path, photos=False).views, path.stem, scene)


def _camera_of(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> bpy.types.Object:
    camera = camera or scene.camera
    if camera is None:
        raise BadRequest(f"The scene {scene.name!r} has no camera.", "Add one, or choose a camera of the capture.")
    return camera


def frame_range(scene: bpy.types.Scene) -> range:
    """The scene's own frames."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def _pictures(views: str, edit: str | list[str], out: Path, base: str) -> tuple[str, dict]:
    options = {"views": views, "edit": edit, "out": str(out), "planes": False, "depth": False, "base": base}
    return "render", options
