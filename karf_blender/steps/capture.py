"""Step 1: a capture becomes the scene's rig and project, is checked, and moves with the file; poses of photos."""

import os
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from .. import progress
from ..engine_api import BadRequest, Capture, KarfError, Message, Project, Request, hold_out, open_capture
from ..host import windows
from ..host.words import kept, translatable
from ..marking import history, mask_layers
from ..pictures import editors
from ..preferences import state
from ..project import captures, disk, folders, moving
from ..rig import cameras
from ..swatches import displayed, palettes
from ..tasks import queries, runner
from ..tasks.runner import Owner, Task
from . import requests
from .views import show_camera

USUAL_RIG = cameras.Options()
SPLAT_VIEWS = 48  # around splats without photos
MAP_NAME = f"{editors.PREFIX} more photos"
SMALL = 512  # long side of photos, pixels, up to which the preset "demo" learns all of their detail


def import_capture(
    scene: bpy.types.Scene,
    path: str | Path,
    project: str | Path | None = None,
    holdout: int | None = None,
    rig: cameras.Options = USUAL_RIG,
) -> Capture:
    """Build the rig of a capture, a folder or a camera file, and make it the scene's; its warnings say what is missing.

    Palettes and masks of another capture leave the scene; they are kept in the project that they were made in. The
    folder `project` is for the results; default: that of this capture, else one beside the .blend. A `holdout` of N
    keeps every Nth photo out of learning where the capture declares none; 0: none; default: as the project was learned.
    """
    captures.forget()
    path, project = Path(path).absolute(), Path(project).absolute() if project else None
    capture = open_capture(path)
    path = _place_of(path, capture)
    karf = scene.karf
    is_known = bool(karf.project) and folders.place_of(scene, "capture") == path
    chosen = {view.name: (view.is_learned, view.is_blurred) for view in karf.views} if is_known else {}
    if project is None:
        project = folders.project_of(scene).folder if is_known else folders.default_project(path)
    capture = hold_out(capture, Project(project).holdout() if holdout is None else holdout)
    try:  # from here on a project that is not there is missing
        project.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        capture = replace(capture, warnings=(*capture.warnings, f"{project} cannot be made: {error.strerror}."))
    if cameras.is_new(scene):
        scene.view_settings.view_transform = "Standard"
        remark = translatable("The view transform is now Standard, which shows colors as the photos have them.")
        capture = replace(capture, warnings=(remark, *capture.warnings))
    karf.rig = cameras.build(capture, f"KaRF {project.name}", scene, rig)
    with displayed.batched(scene):
        if not is_known:
            palettes.load_palettes(scene, ())
            karf.advice, karf.is_poor = "", False
            if not karf.is_property_set("preset"):
                karf.preset = _proposed_preset(capture)
            if karf.capture:  # the masks are of that one's photos
                karf.masks = ""
        folders.store(scene, "capture", path)
        folders.store(scene, "project", project)
        karf.holdout = capture.holdout
        karf.n_points = 0 if capture.points is None else len(capture.points)
        karf.views.clear()
        left_out = disk.read(scene).left_out
        for each in capture.views:
            item = karf.views.add()
            item.name, item.split = each.name, each.split
            item.is_learned, item.is_blurred = chosen.get(each.name, (each.name not in left_out, False))
        first = next(iter(capture.split("train")), capture.views[0])  # masks are mostly painted on a view that learns
        karf.active_view = first.name
    try:
        show_camera(scene, capture, first)
    except KarfError as error:  # the rig is built; one unreadable photo must not remove it
        capture = replace(capture, warnings=(*capture.warnings, error.sentence))
    return capture


def _proposed_preset(capture: Capture) -> str:
    """Return the preset for a first try: "demo" is for small pictures, such as the demo's."""
    camera = capture.views[0].camera
    return "demo" if max(camera.width, camera.height) <= SMALL else "fast"


def _place_of(path: Path, capture: Capture) -> Path:
    """Return the folder of the camera file, or of it and the photos: a capture has one path, however it is chosen."""
    photos = [each.image for each in capture.views]
    start = path.parent if path.is_file() else path
    try:
        common = Path(os.path.commonpath([start, *(photo.parent for photo in photos if photo)]))
    except ValueError:  # several drives
        common = start
    for folder in (common, start):
        if folder == path:
            break
        try:
            found = open_capture(folder)
        except KarfError:
            continue
        if found.format == capture.format and [each.image for each in found.views] == photos:
            return folder
    return path


def find_poses(scene: bpy.types.Scene, photos: str | Path, rig: cameras.Options = USUAL_RIG) -> Task:
    """Find the camera poses of photos or a video, and import the capture, the task's result, as a new project."""
    photos = Path(photos).absolute()
    named = photos.with_suffix("") if photos.is_file() else photos
    return _task_of_new_capture(scene, "Find Camera Poses", named, ("poses", {"photos": str(photos)}), rig)


def import_splat(
    scene: bpy.types.Scene,
    splat: str | Path,
    photos: str | Path | None = None,
    cameras_file: str | Path | None = None,
    views: int = SPLAT_VIEWS,
    up: str = "auto",
    antialiased: bool = False,
    rig: cameras.Options = USUAL_RIG,
) -> Task:
    """Import Gaussian splats that another program has learned as a capture, the task's result, in a new project.

    Args:
        photos: Their capture; None: views are rendered from cameras around them.
        cameras_file: Without photos, the cameras to render, as `export_cameras` writes them.
        views: Without photos, the number of cameras.
        up: Without photos, the axis that points up: `auto`, `x`, `y`, `z`, `-x`, `-y` or `-z`.
        antialiased: They were learned with antialiasing, even if neither file nor photos say so.
    """
    splat = Path(splat).absolute()
    given = {"photos": photos, "cameras": cameras_file}
    paths = {name: str(Path(path).absolute()) for name, path in given.items() if path}
    chosen = {} if photos else {"views": views, "up": up}
    job = "import-splat", {"splat": str(splat), **paths, **chosen, "antialiased": antialiased}
    return _task_of_new_capture(scene, "Import Splat", splat.with_suffix(""), job, rig)


def _task_of_new_capture(
    scene: bpy.types.Scene, title: str, named: Path, job: requests.Job, rig: cameras.Options
) -> Task:
    """The task of a job that makes a capture in a new project folder called after `named`, and imports it."""
    wanted = project = folders.default_project(named)
    number = 2
    while (project / "capture").exists():  # made before: what was learned of it stays
        project, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
    out, owner = project / "capture", Owner.of(scene)

    def import_made(request: Request) -> None:
        found = owner.find()
        if found is None:
            progress.warn(
                "The scene that requested the capture is gone or has another project: import {out} by hand.", out=out
            )
        else:
            import_capture(found, out, project, rig=rig)

    stage, options = job
    request = Request(stage, project, options | {"out": str(out)} | requests.threads())
    return Task(title, (request,), import_made, owner, result=partial(captures.of, scene))


def check_capture(scene: bpy.types.Scene, shows_map: bool = True) -> None:
    """Ask the engine how good the scene's capture is; `shows_map`: and show where more photos would help."""
    masks = folders.place_of(scene, "masks")
    options = {
        "capture": str(captures.path_of(scene)),
        "holdout": max(0, scene.karf.holdout),
        "masks": str(masks) if masks is not None and masks.is_dir() else None,
        "without": captures.left_out(scene),
    }
    queries.send(scene, "inspect", options, partial(_take_inspection, shows_map))


def check_unasked(scene: bpy.types.Scene) -> None:
    """Check a capture that was just imported, if there is an engine and nothing is learned of it. Never raises."""
    if bpy.app.background or state.known().problem or disk.read(scene).stages or scene.karf.advice:
        return
    with progress.printing_errors():
        check_capture(scene, shows_map=False)


def _take_inspection(shows_map: bool, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    messages = [Message.from_json(each) for each in values["advice"]]
    scene.karf.advice = "\n".join(map(kept, messages))
    scene.karf.is_poor = values["is_poor"]
    for view in scene.karf.views:
        view.is_blurred = view.name in values["blurred"]
    path = folders.project_of(scene).path("inspection", "more_photos.png")
    path.parent.mkdir(exist_ok=True)
    shutil.move(values["picture"], path)
    windows.redraw()
    if not shows_map:
        return
    image = bpy.data.images.get(MAP_NAME)
    if image is None:
        image = bpy.data.images.load(folders.stored(path))
        image.name = MAP_NAME
    image.filepath = folders.stored(path)
    image.reload()
    editors.reveal(image, is_wanted=True, is_whole=True)


def leave_out_blurred(scene: bpy.types.Scene) -> list[str]:
    """Leave the photos out of learning that `check_capture` has found blurred; return their names."""
    blurred = [view for view in scene.karf.views if view.is_blurred]
    if not blurred:
        raise BadRequest("No blurred photos are known.", "Check the capture first.")
    for view in blurred:
        view.is_learned = False
    return [view.name for view in blurred]


def move_project(scene: bpy.types.Scene) -> Path:
    """Move the project from the extension's own folder to beside the .blend, which is saved; return its new folder.

    Raises KarfError if a job runs, the file was never saved, or a disk cannot be written; nothing is lost.
    """
    if runner.is_running():
        raise BadRequest("A KaRF job is running.", "Wait for it, or cancel it.")
    queries.stop()
    runner.release()
    place = moving.move(scene)
    history.forget()  # it knows files by their old places
    mask_layers.forget()
    displayed.forget(scene)
    return place
