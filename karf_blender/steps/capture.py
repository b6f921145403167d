"""Step 1: a capture becomes the scene's rig and project; poses are found for photos that have none."""

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from .. import progress
from ..engine_api import Capture, DataError, KarfError, Message, Project, Request, hold_out, open_capture
from ..project import captures, folders
from ..rig import cameras, factory
from ..swatches import displayed, palettes
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import requests, view

USUAL_RIG = cameras.Options()
SPLAT_VIEWS = 48  # that are chosen around splats without photos


def import_capture(
    scene: bpy.types.Scene,
    path: str | Path,
    project: str | Path | None = None,
    holdout: int | None = None,
    rig: cameras.Options = USUAL_RIG,
) -> Capture:
    """Build the rig of a capture and make it the scene's.

    Palettes and masks of another capture leave the scene; they are kept in the project that they were made in.

    Args:
        scene: The scene.
        path: The capture's folder or camera file.
        project: Folder of all that is learned; default: the one the scene has of this capture, else one beside the
            .blend.
        holdout: N keeps every Nth photo out of learning where the capture declares none; 0: none. Default: as the
            project was learned, else 0.
        rig: How the rig is shown.

    Returns:
        The capture; its remarks say what could not be had.
    """
    captures.forget()
    path, project = Path(path).absolute(), Path(project).absolute() if project else None
    capture = open_capture(path)
    path = _place_of(path, capture)
    karf = scene.karf
    is_known = bool(karf.project) and karf.capture == folders.stored(path)
    if project is None:
        project = folders.project_of(scene).folder if is_known else folders.default_project(path)
    capture = hold_out(capture, Project(project).holdout() if holdout is None else holdout)
    try:  # from here on a project that is not there is missing
        project.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        capture = replace(capture, warnings=(*capture.warnings, f"{project} cannot be made: {error.strerror}."))
    cube = factory.find_cube(scene)
    karf.rig = cameras.build(capture, f"KaRF {project.name}", scene, rig)
    if cube is not None:  # it would stand amid what was captured
        factory.remove(cube)
    with displayed.batched(scene):
        if not is_known:
            palettes.load_palettes(scene, ())
            karf.advice, karf.is_poor = "", False
            if karf.capture:  # the masks are of that one's photos
                karf.masks = ""
        karf.capture = folders.stored(path)
        karf.project = folders.stored(project)
        karf.holdout = capture.holdout
        karf.n_points = 0 if capture.points is None else len(capture.points)
        karf.views.clear()
        for each in capture.views:
            item = karf.views.add()
            item.name, item.split = each.name, each.split
        # a view that learns: masks are mostly painted on it
        first = next(iter(capture.split("train")), capture.views[0])
        karf.active_view = first.name
    try:
        view.show_camera(scene, capture, first)
    except DataError as error:  # the rig is built; one unreadable photo must not remove it
        capture = replace(capture, warnings=(*capture.warnings, error.sentence))
    return capture


def _place_of(path: Path, capture: Capture) -> Path:
    """The folder of the camera file, or that of camera file and photos, where it is the same capture.

    Chosen in whichever way, a capture has one path and one project.
    """
    photos = [each.image for each in capture.views]
    start = path.parent if path.is_file() else path
    for folder in (_common_folder([start, *(photo.parent for photo in photos if photo)]), start):
        if folder == path:
            break
        try:
            found = open_capture(folder)
        except KarfError:
            continue
        if found.format == capture.format and [each.image for each in found.views] == photos:
            return folder
    return path


def _common_folder(places: list[Path]) -> Path:
    try:
        return Path(os.path.commonpath(places))
    except ValueError:  # several drives
        return places[0]


def find_poses(scene: bpy.types.Scene, photos: str | Path, rig: cameras.Options = USUAL_RIG) -> Task:
    """Find the camera poses of a folder of photos, or of a video, in a new project folder, and import their capture.

    Args:
        scene: The scene.
        photos: The folder or the video.
        rig: How the rig is shown.

    Returns:
        The task; its result is the capture.
    """
    photos = Path(photos).absolute()
    named = photos.with_suffix("") if photos.is_file() else photos
    job = "poses", {"photos": str(photos)}
    return _task_of_new_capture(scene, "Find Camera Poses", named, job, rig)


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
    """Import Gaussian splats that another program has learned, as a capture in a new project folder.

    Args:
        scene: The scene.
        splat: The file.
        photos: The capture that they were learned from; None: views are rendered from cameras around them.
        cameras_file: Without photos, views of one's own, as `export_cameras` writes them.
        views: Without photos, how many cameras are chosen.
        up: Without photos, which axis points up: `auto`, `x`, `y`, `z`, `-x`, `-y` or `-z`.
        antialiased: Whether they were learned with antialiasing where neither file nor photos say so.
        rig: How the rig is shown.

    Returns:
        The task; its result is the capture.
    """
    splat = Path(splat).absolute()
    given = {"photos": photos, "cameras": cameras_file}
    paths = {name: str(Path(path).absolute()) for name, path in given.items() if path}
    chosen = {} if photos else {"views": views, "up": up}
    job = "import-splat", {"splat": str(splat), **paths, **chosen, "antialiased": antialiased}
    return _task_of_new_capture(scene, "Import Splat", splat.with_suffix(""), job, rig)


def _task_of_new_capture(
    scene: bpy.types.Scene, label: str, named: Path, job: tuple[str, dict[str, Any]], rig: cameras.Options
) -> Task:
    """The task of a job that makes a capture in a new project folder, which is then imported.

    Args:
        scene: The scene.
        label: What the task is called.
        named: The folder, there or not, after which the project is called.
        job: The engine's stage and its options but the capture's folder.
        rig: How the rig is shown.
    """
    wanted = project = folders.default_project(named)
    number = 2
    while (project / "capture").exists():  # made before: what was learned of it stays
        project, number = wanted.with_name(f"{wanted.name}_{number}"), number + 1
    out, owner = project / "capture", Owner.of(scene)

    def import_made(request: Request) -> None:
        found = owner.find()
        if found is None:
            progress.warn(
                Message(
                    "The scene that requested the capture is gone or has another project: import {out} by hand.",
                    out=out,
                )
            )
        else:
            import_capture(found, out, project, rig=rig)

    stage, options = job
    request = Request(stage, project, options | {"out": str(out)} | requests.threads())
    return Task(label, (request,), import_made, owner, result=partial(captures.of, scene))
