"""Step 5: floaters, stray splats, deleted by boxes in the 3D View."""

from collections.abc import Collection, Sequence
from functools import partial

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import BadRequest, Message
from ..project import folders
from ..rig import lens
from ..tasks.runner import Task
from . import requests

NAME = "KaRF Delete Box"
SIZE = 0.5  # of a new box, relative to the rig's axes


def is_delete_box(item: bpy.types.Object) -> bool:
    """Return whether an object was made by `add_delete_box`, or is a copy of such a one."""
    return item.type == "EMPTY" and item.name.startswith(NAME)


def add_delete_box(scene: bpy.types.Scene, place: Sequence[float] | None = None) -> bpy.types.Object:
    """Add an Empty shown as a cube, half as large as the rig's axes, and select it alone.

    place: its center in Blender's world (default: the 3D cursor).
    """
    requests.check_rig(scene)
    rig, layer = scene.karf.rig, scene.view_layers[0]
    box = bpy.data.objects.new(NAME, None)
    box.empty_display_type = "CUBE"
    box.location = scene.cursor.location if place is None else place
    box.scale = SIZE * rig.empty_display_size * rig.matrix_world.to_scale()
    scene.collection.objects.link(box)
    for other in list(layer.objects.selected):
        other.select_set(False, view_layer=layer)
    box.select_set(True, view_layer=layer)
    layer.objects.active = box
    return box


def delete_inside(scene: bpy.types.Scene, boxes: Sequence[bpy.types.Object]) -> Task:
    """Delete the splats whose centers are in the cubes of these Empties, and then the Empties.

    The task's result is how many splats are deleted now; `restore_splats` brings them back.
    """
    requests.check_rig(scene)
    if not boxes:
        raise BadRequest("No delete box is selected.", "Add one, move it over the floaters, and select it.")
    layer = scene.view_layers[0]
    layer.update()
    to_capture, matrices = lens.to_capture(layer.depsgraph, scene), []
    for box in boxes:
        placed = box.evaluated_get(layer.depsgraph).matrix_world
        matrices.append(np.ravel(to_capture @ placed @ Matrix.Scale(box.empty_display_size, 4)).tolist())
    where = Message("The splats are deleted in {path}.", path=folders.project_of(scene).folder)
    finish = requests.presenting(partial(_remove, {box.session_uid for box in boxes}), where)
    return requests.task(
        scene, "Delete Inside", ("erase", {"boxes": matrices}), finish=finish, result=partial(_n_deleted, scene)
    )


def restore_splats(scene: bpy.types.Scene) -> Task:
    """Bring back all splats that `delete_inside` has deleted; the task's result is 0."""
    return requests.task(scene, "Restore All", ("erase", {"restore": True}), result=partial(_n_deleted, scene))


def _remove(boxes: Collection[int], scene: bpy.types.Scene) -> None:
    """Remove the objects of these `session_uid` from the file."""
    for item in [item for item in scene.objects if item.session_uid in boxes]:
        bpy.data.objects.remove(item)


def _n_deleted(scene: bpy.types.Scene) -> int:
    return folders.project_of(scene).require("splats")["erased"]
