"""Step 7: the scene as Gaussian splats in files of other programs."""

from pathlib import Path

import bpy
import numpy as np

from ..engine_api import BadRequest, Message
from ..project import captures, folders
from ..tasks.ownership import Owner
from ..tasks.task import Task
from . import requests
from .edit import save_edit

# from Blender's axes to those of a PLY file by COLMAP: x right, y down, z forward
FROM_BLENDER = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
AXES = ("auto", "capture", "blender", "viewers")


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
        scene: The scene, whose splats are learned or imported.
        path: The file: `.ply`, `.compressed.ply`, `.spz`, `.glb`, `.gltf`, `.usd`, `.usda` or `.usdc`.
        axes: `capture`, those of the capture's own world, in which splats were imported; `blender`, where the rig stands
            and as large as it is, z up (other kinds of files than .ply say what is up, and get it); `viewers`, the same
            with y down, as most programs show a .ply; `auto`: `capture` for imported splats, else `blender`.
        objects: Only these are cut out; none: the whole scene.
        solid: Whether to leave out the shell that shows what is behind the scene.
        attributes: Whether to add each Gaussian's object, probability and palette weights; `.ply` only.

    Returns:
        The task; its result is the file's path.

    Raises:
        BadRequest: The scene has no captured cameras, or the axes are unknown.
    """
    karf, path = scene.karf, Path(path).absolute()
    if karf.rig is None:
        raise BadRequest("The scene {name!r} has no captured cameras.", "Import the capture first.", name=scene.name)
    if axes not in AXES:
        raise BadRequest("There are no axes {axes}.", "Use one of: {known}.", axes=axes, known=", ".join(AXES))
    options = {"out": str(path), "objects": list(objects), "solid": solid, "attributes": attributes}
    if axes == "auto":
        axes = "blender" if captures.of(scene).splats is None else "capture"
    if axes != "capture":
        options["matrix"] = _matrix_of(karf.rig, path, axes).ravel().tolist()
    if len(karf.objects):
        edit = folders.project_of(scene).folder / "exported_edit.json"
        save_edit(scene, edit)
        options["edit"] = str(edit)

    def told(owner: Owner, request) -> None:
        del request
        requests.find_scene(owner, Message("The splats are in {path}.", path=path))

    return requests.task(scene, "Export Splat", ("export-splat", options), finish=told, result=lambda: path)


def _matrix_of(rig: bpy.types.Object, path: Path, axes: str) -> np.ndarray:
    """From the capture's world to that of a file, [4, 4] float64."""
    matrix = np.array(rig.matrix_world, np.float64)
    return matrix if path.suffix.lower() == ".ply" and axes == "blender" else FROM_BLENDER @ matrix
