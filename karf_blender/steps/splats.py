"""Step 5: the scene as Gaussian splats in files of other programs, and in objects that these have imported.

An object follows the swatches: one timer compares them, so that anything that changes them counts, and requests colors
from the engine, the next ones when the last have come.
"""

import json
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
from .swatches import save_edit

# from Blender's axes to those of a PLY file by COLMAP: x right, y down, z forward
FROM_BLENDER = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
AXES = ("auto", "capture", "blender", "viewers")
KIND = "harmonics"
TICK_SECONDS = 0.05


class _Requested(dict[int, str]):
    """The `_color_key` of the colors that each scene's object (by `session_uid`) has or will get."""


def export_splat(
    scene: bpy.types.Scene,
    path: str | Path,
    axes: str = "auto",
    objects: tuple[str, ...] = (),
    solid: bool = False,
    attributes: bool = False,
) -> Task:
    """Write the scene's splats with the swatches as they are to a file, the task's result.

    Args:
        path: `.ply`, `.compressed.ply`, `.spz`, `.sog`, `.glb`, `.gltf`, `.usd`, `.usda` or `.usdc`.
        axes: `capture`: its own world; `blender`: at the rig, z up (or as the kind of file defines); `viewers`: y down,
            as most programs show a .ply; `auto`: `capture` for imported splats, else `blender`.
        objects: Only these are cut out; none: the whole scene.
        solid: Whether to leave out the shell that shows what is behind the scene.
        attributes: Whether to add each Gaussian's object, probability and palette weights; `.ply` only.
    """
    requests.check_rig(scene)
    karf, path = scene.karf, Path(path).absolute()
    if axes not in AXES:
        raise BadRequest("Unknown axes {axes}.", "Use one of: {known}.", axes=axes, known=", ".join(AXES))
    options = {"out": str(path), "objects": list(objects), "solid": solid, "attributes": attributes}
    if axes == "auto":
        axes = "blender" if captures.of(scene).splats is None else "capture"
    if axes != "capture":
        matrix = np.array(karf.rig.matrix_world, np.float64)  # from the capture's world to the file's
        if path.suffix.lower() != ".ply" or axes != "blender":
            matrix = FROM_BLENDER @ matrix
        options["matrix"] = matrix.ravel().tolist()
    if len(karf.objects):
        edit = folders.project_of(scene).path("exported_edit.json")
        save_edit(scene, edit)
        options["edit"] = str(edit)
    finish = requests.presenting(lambda _: None, Message("The splats are in {path}.", path=path), path.parent)
    return requests.task(scene, "Export Splat", ("export-splat", options), finish=finish, result=lambda: path)


def follow_splat(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Give an object of splats the swatches' colors, now and whenever they change; what followed before keeps its own.

    The object is a point cloud of Blender, or a mesh of KIRI's add-on, of all the scene's splats, or all but the
    background. In background mode nothing follows: call this again after a change.
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
    """Stop following the swatches; the object keeps its colors."""
    scene.karf.surface.splat = None


def _start() -> None:
    if not bpy.app.background:  # a timer that is left at the exit crashes or hangs some Blender versions
        session.start_timer(_tick, persistent=True)


def _tick() -> float | None:
    followed = _followed_scenes()
    if runner.is_running():
        session.get(_Requested).clear()  # what a task learns changes the splats, and meanwhile the cores are its own
    elif rendering.is_over() and not queries.is_waiting(KIND):
        changed = next((scene for scene in followed if _has_changed(scene)), None)
        if changed is not None:
            try:
                _ask(changed)
            except KarfError as error:
                progress.fail(error)
    return TICK_SECONDS if followed else None


def _followed_scenes() -> list[bpy.types.Scene]:
    return [scene for scene in bpy.data.scenes if scene.karf.surface.splat is not None]


def _has_changed(scene: bpy.types.Scene) -> bool:
    item = splat_objects.find(scene)
    is_ready = item is not None and item.mode != "EDIT" and scene.karf.project
    return bool(is_ready) and _color_key(scene) != session.get(_Requested).get(scene.session_uid)


def _color_key(scene: bpy.types.Scene) -> str:
    karf = scene.karf
    return json.dumps([karf.project, karf.surface.splat.session_uid, edits.edit_option(scene)])


def _ask(scene: bpy.types.Scene) -> None:
    session.get(_Requested)[scene.session_uid] = _color_key(scene)
    points = splat_objects.points_of(scene.karf.surface.splat)
    queries.send(scene, KIND, {"edit": edits.edit_option(scene), "points": points}, _take)


def _take(scene: bpy.types.Scene, answer: dict[str, Any]) -> None:
    """Show an answer, unless the object cannot show it by now."""
    harmonics = camera_pixels.arrays_of(answer)["harmonics"]
    item = splat_objects.find(scene)
    if item is None or item.mode == "EDIT":
        session.get(_Requested).pop(scene.session_uid, None)
        return
    splat_objects.write(item, harmonics)
    windows.redraw("VIEW_3D")


@session.handler("undo_post", "redo_post", phase=session.Phase.REPORT)
def _after_undo(*_):
    session.get(_Requested).clear()  # undo may take colors back that came after a swatch had changed
    _start()


@session.handler("load_post", phase=session.Phase.REPORT)
def _after_load(*_):
    # a saved object has the colors of the saved swatches: the engine starts when one changes
    session.get(_Requested).clear()
    session.get(_Requested).update({scene.session_uid: _color_key(scene) for scene in _followed_scenes()})
    _start()
