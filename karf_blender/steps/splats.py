"""Step 7: the scene as Gaussian splats in files of other programs, and in objects that these have imported.

An object follows the swatches: one timer looks at them, so that anything that changes them counts, and asks the engine for
colors, the next ones when the last have come.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import progress, session
from ..engine_api import BadRequest, KarfError, Message
from ..host import rendering, windows
from ..project import captures, folders
from ..render_engine import camera_pixels
from ..surface import splat_objects
from ..swatches import edits
from ..tasks import queries, runner
from ..tasks.runner import Task
from . import requests
from .edit import save_edit

# from Blender's axes to those of a PLY file by COLMAP: x right, y down, z forward
FROM_BLENDER = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
AXES = ("auto", "capture", "blender", "viewers")
KIND = "harmonics"
LOOK_SECONDS = 0.05


@dataclass
class _State:
    """What the object of each scene (by `session_uid`) has, or was asked for: see `_wanted`."""

    asked: dict[int, str] = field(default_factory=dict)


# --- files ---------------------------------------------------------------------------------------------------------
def export_splat(
    scene: bpy.types.Scene,
    path: str | Path,
    axes: str = "auto",
    objects: tuple[str, ...] = (),
    solid: bool = False,
    attributes: bool = False,
) -> Task:
    """Write the scene's splats with the swatches as they stand.

    Args:
        path: The file: `.ply`, `.compressed.ply`, `.spz`, `.glb`, `.gltf`, `.usd`, `.usda` or `.usdc`.
        axes: `capture`, those of the capture's own world, in which splats were imported; `blender`, where the rig stands
            and as large as it is, z up (other kinds of files than .ply say what is up, and get it); `viewers`, the same
            with y down, as most programs show a .ply; `auto`: `capture` for imported splats, else `blender`.
        objects: Only these are cut out; none: the whole scene.
        solid: Whether to leave out the shell that shows what is behind the scene.
        attributes: Whether to add each Gaussian's object, probability and palette weights; `.ply` only.

    Returns:
        The task; its result is the file's path.
    """
    requests.check_rig(scene)
    karf, path = scene.karf, Path(path).absolute()
    if axes not in AXES:
        raise BadRequest("Unknown axes {axes}.", "Use one of: {known}.", axes=axes, known=", ".join(AXES))
    options = {"out": str(path), "objects": list(objects), "solid": solid, "attributes": attributes}
    if axes == "auto":
        axes = "blender" if captures.of(scene).splats is None else "capture"
    if axes != "capture":
        options["matrix"] = _matrix_of(karf.rig, path, axes).ravel().tolist()
    if len(karf.objects):
        edit = folders.project_of(scene).path("exported_edit.json")
        save_edit(scene, edit)
        options["edit"] = str(edit)

    finish = requests.presenting(lambda _: None, Message("The splats are in {path}.", path=path), path.parent)
    return requests.task(scene, "Export Splat", ("export-splat", options), finish=finish, result=lambda: path)


def _matrix_of(rig: bpy.types.Object, path: Path, axes: str) -> np.ndarray:
    """From the capture's world to that of a file, [4, 4] float64."""
    matrix = np.array(rig.matrix_world, np.float64)
    return matrix if path.suffix.lower() == ".ply" and axes == "blender" else FROM_BLENDER @ matrix


# --- objects -------------------------------------------------------------------------------------------------------
def follow_splat(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Give an object of splats the swatches' colors, now and whenever they change; what followed before keeps its own.

    In background mode nothing follows: call this again after a change.

    Args:
        item: A point cloud of Blender, or a mesh of KIRI's add-on, that was imported from a file of the scene's splats,
            all of them or all but what is behind the scene.
    """
    if not splat_objects.is_splat(item):
        raise BadRequest(
            "{name} is not a splat object.",
            "Choose one imported by Blender or 3DGS Render from a .ply.",
            name=item.name,
        )
    if item.mode == "EDIT":
        raise BadRequest("{name} is in Edit Mode.", "Leave Edit Mode first.", name=item.name)
    scene.karf.surface.splat = item
    _ask(scene)
    _start()


def unfollow_splat(scene: bpy.types.Scene) -> None:
    """Let the object that follows the swatches keep the colors that it has."""
    scene.karf.surface.splat = None


def _start() -> None:
    if not bpy.app.background:
        session.start_timer(_look, persistent=True)


def _look() -> float | None:
    """Called by the timer as long as an object follows."""
    followed = [scene for scene in bpy.data.scenes if scene.karf.surface.splat is not None]
    if runner.is_running():
        session.get(_State).asked.clear()  # what a task learns changes the splats, and meanwhile the cores are its own
    elif rendering.is_over() and not queries.is_waiting(KIND):
        changed = next((scene for scene in followed if _has_changed(scene)), None)
        if changed is not None:
            try:
                _ask(changed)
            except KarfError as error:
                progress.fail(error)
    return LOOK_SECONDS if followed else None


def _has_changed(scene: bpy.types.Scene) -> bool:
    item = splat_objects.find(scene)
    is_ready = item is not None and item.mode != "EDIT" and scene.karf.project
    return bool(is_ready) and _wanted(scene) != session.get(_State).asked.get(scene.session_uid)


def _wanted(scene: bpy.types.Scene) -> str:
    """What the colors depend on, as a comparable text."""
    karf = scene.karf
    return json.dumps([karf.project, karf.surface.splat.session_uid, edits.edit_option(scene)])


def _ask(scene: bpy.types.Scene) -> None:
    session.get(_State).asked[scene.session_uid] = _wanted(scene)
    points = splat_objects.points_of(scene.karf.surface.splat)
    queries.send(scene, KIND, {"edit": edits.edit_option(scene), "points": points}, _take)


def _take(scene: bpy.types.Scene, answer: dict[str, Any]) -> None:
    """Show an answer, unless the object cannot show it by now."""
    harmonics = camera_pixels.arrays_of(answer)["harmonics"]
    item = splat_objects.find(scene)
    if item is None or item.mode == "EDIT":
        session.get(_State).asked.pop(scene.session_uid, None)
        return
    splat_objects.write(item, harmonics)
    windows.redraw("VIEW_3D")


@session.handler("undo_post", "redo_post", phase=session.Phase.REPORT)
def _after_undo(*_):
    # undo may take colors back that came after a swatch had changed
    session.get(_State).asked.clear()
    _start()


@session.handler("load_post", phase=session.Phase.REPORT)
def _after_load(*_):
    # an object that was saved has the colors of the swatches that were saved: the engine starts when one changes
    followed = [scene for scene in bpy.data.scenes if scene.karf.surface.splat is not None]
    session.get(_State).asked = {scene.session_uid: _wanted(scene) for scene in followed}
    _start()
