"""Step 3: what the engine learns."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..engine_api import BadRequest
from ..project import captures, folders
from ..swatches import colors
from ..tasks.runner import Task
from . import requests


def learn_scene(
    scene: bpy.types.Scene, preset: str = "", overrides: Sequence[str] = (), nerf: str | Path | None = None
) -> Task:
    """Learn the geometry from the photos, or import that of a `nerf`, a checkpoint of another program.

    Single settings override those of the `preset`, as `stage.field=value`. What is chosen becomes the panel's. The
    task's result, as of `segment` and `learn_splats`, is the stage's entry in the project (seconds, metrics).
    """
    if nerf is not None:
        folders.store(scene, "nerf", Path(nerf).absolute())
    jobs = _geometry(scene, preset, overrides), *_imported_splats(scene)
    return requests.task(scene, "Learn Scene", *jobs, result=partial(_entry, scene, "geometry"))


def learn_all(scene: bpy.types.Scene, preset: str = "", overrides: Sequence[str] = ()) -> Task:
    """Learn scene, objects and palettes in a row, then as `extract_palette`; what is done already is kept."""
    learned = _geometry(scene, preset, overrides), _segmentation(scene, None)
    jobs = *learned, *_palettes(scene), *_imported_splats(scene)
    return requests.task(scene, "Learn All", *jobs, result=partial(colors.palettes, scene))


def segment(scene: bpy.types.Scene, masks: str | Path | None = None) -> Task:
    """Segment the objects by coarse masks, `<object>/<photo name>.png` in a folder (default: the panel's)."""
    job = _segmentation(scene, Path(masks).absolute() if masks else None)
    return requests.task(scene, "Segment", job, result=partial(_entry, scene, "segmentation"))


def extract_palette(scene: bpy.types.Scene) -> Task:
    """Extract and learn the palettes, and prepare the active view; the task's result is the palette of each object."""
    return requests.task(scene, "Extract Palette", *_palettes(scene), result=partial(colors.palettes, scene))


def learn_splats(scene: bpy.types.Scene, quality: str = "") -> Task:
    """Learn the scene as Gaussians: they render new cameras sharply and quickly.

    quality: `draft`, `good` or `best` (default: the panel's), which becomes the panel's.
    """
    scene.karf.splat_quality = quality or scene.karf.splat_quality
    job = "splats", {"quality": scene.karf.splat_quality}
    return requests.task(scene, "Learn Splats", job, result=partial(_entry, scene, "splats"))


def _entry(scene: bpy.types.Scene, stage: str) -> dict[str, Any]:
    return folders.project_of(scene).finished(stage)


def _geometry(scene: bpy.types.Scene, preset: str, overrides: Sequence[str]) -> requests.Job:
    scene.karf.preset = preset or scene.karf.preset
    return "geometry", {
        "capture": str(captures.path_of(scene)),
        "preset": scene.karf.preset,
        "overrides": list(overrides),
        "nerf": folders.text_of(scene, "nerf") or None,
        "holdout": scene.karf.holdout if scene.karf.holdout >= 0 else None,
        "without": captures.left_out(scene),
        "photo_space": scene.karf.photo_space or None,
        "ocio": folders.text_of(scene, "ocio") or None,
        "masks": folders.text_of(scene, "masks") or None,
    }


def _imported_splats(scene: bpy.types.Scene) -> tuple[requests.Job, ...]:
    """The job that takes over the capture's own splats, which is quick; none where they would have to be learned."""
    return (("splats", {}),) if captures.of(scene).splats else ()


def _segmentation(scene: bpy.types.Scene, folder: Path | None) -> requests.Job:
    folder = folder or folders.place_of(scene, "masks")
    if folder is None:
        raise BadRequest("No masks were chosen.", "Choose a folder with <object>/<photo name>.png, or paint a mask.")
    folders.store(scene, "masks", folder)
    return "segmentation", {"masks": str(folder)}


def _palettes(scene: bpy.types.Scene) -> tuple[requests.Job, ...]:
    return ("palette", {}), ("recoloring", {}), requests.render(scene.karf.active_view, planes=True)
