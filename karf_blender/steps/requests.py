"""Tasks and jobs of the steps, and what becomes of their results."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from .. import preferences, progress
from ..engine_api import BadRequest, Message, Project, Request, read_palettes
from ..marking import photo
from ..pictures import editors
from ..project import disk, folders
from ..render_engine import camera_pixels
from ..rig import cameras
from ..swatches import displayed, outputs, palettes
from ..tasks.runner import Owner, Task
from ..workspace import estimates

# the engine's names of what Blender's output panel calls file format and color depth
FORMATS = {
    "PNG": {"8": "png8", "16": "png16", "32": "png16"},
    "OPEN_EXR": {"8": "exr16", "16": "exr16", "32": "exr32"},
}

Job = tuple[str, dict[str, Any]]  # the engine's stage and its options
Finish = Callable[[Owner, Request], None]


def import_results(owner: Owner, request: Request) -> None:
    """Import what a job has learned into the scenes of its project in the file that began it, or warn where it is."""
    if request.stage == "segmentation":
        for scene in owner.scenes():
            cameras.turn_views_about_object(scene)
    brings_planes = request.stage == "render" and request.options["planes"]
    if request.stage != "recoloring" and not brings_planes:
        return
    scenes = list(owner.scenes())
    if not scenes:
        progress.warn(
            "The scene that requested this is gone or has another project. The result is in {project}: "
            "choose that project to load it.",
            project=request.project,
        )
    for scene in scenes:
        if request.stage == "recoloring":
            displayed.forget(scene)
            palettes.load_palettes(scene, read_palettes(Project(request.project).palette_file))
        elif disk.is_prepared(scene):
            show_recolored(scene)


def show_recolored(scene: bpy.types.Scene, is_wanted: bool = False) -> None:
    """Show the whole active view recolored in the Image Editors, where it takes the place of the photo to mark."""
    editors.reveal(displayed.of(scene).recolor(), is_wanted, is_whole=True)
    photo.leave(scene)


def check_palettes(scene: bpy.types.Scene) -> None:
    if not scene.karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")


def check_rig(scene: bpy.types.Scene) -> None:
    if scene.karf.rig is None:
        raise BadRequest("The scene {name!r} has no captured cameras.", "Import the capture first.", name=scene.name)


def presenting(present: Callable[[bpy.types.Scene], None], where: Message, written: Path | None = None) -> Finish:
    """Make a `finish` that presents a result to the job's scene, or warns `where` it is, in the folder `written`."""

    def finish(owner: Owner, _: Request) -> None:
        if written is not None:
            progress.wrote(written)
        scene = owner.find()
        if scene is None:
            progress.warn("The scene that requested this is gone or has another project. {result}", result=where)
        else:
            present(scene)

    return finish


def task(
    scene: bpy.types.Scene,
    title: str,
    *jobs: Job,
    finish: Finish = import_results,
    result: Callable[[], Any] = lambda: None,
) -> Task:
    """Make a task of jobs in the scene's project; `finish` is called after each, `result` gives what `wait` returns."""
    project, owner = folders.project_of(scene).folder, Owner.of(scene)
    requests = tuple(Request(stage, project, options | threads()) for stage, options in jobs)
    seconds = estimates.of_jobs([stage for stage, _ in jobs], scene.karf.preset, scene.karf.n_points > 0)
    return Task(title, requests, partial(finish, owner), owner, seconds, result)


def threads() -> dict[str, int]:
    """Return the option that limits the engine's threads, where the preferences do."""
    chosen = preferences.current().threads
    return {"threads": chosen} if chosen else {}


def pictures(
    scene: bpy.types.Scene,
    views: str,
    edit: str | list[str],
    out: Path,
    look: str,
    base: str,
    size: str | int = "photo",
) -> Job:
    """The job that recolors views, on their photos (base `photo`) or on what the engine renders (`render`).

    look: the value of the token {look} of file names.
    """
    karf = scene.karf
    return render(
        views,
        edit=edit,
        out=str(out),
        names=outputs.pattern_of(scene, look),
        base=base,
        size=size,
        skip_existing=karf.skip_existing,
        layered=karf.layered,
        format=FORMATS[karf.file_format][karf.color_depth],
        alpha=karf.color_mode == "RGBA",
        overrides=[] if base == "photo" else [f"render.unseen={camera_pixels.unseen(scene)}"],
    )


def render(views: str, **chosen: Any) -> Job:
    """The job that renders views, with other options than the usual ones."""
    usual = {"edit": None, "out": None, "planes": False, "depth": False, "base": "photo"}
    return "render", {"views": views} | usual | chosen
