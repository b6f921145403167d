"""Volumes: meshes and Empties' boxes of the scene that an object must be inside or outside of."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import BadRequest, Volume, read_volumes, write_volumes
from ..project import folders
from . import history


def count(scene: bpy.types.Scene, name: str) -> int:
    """How many volumes an object has. Reads the disk.

    Raises:
        KarfError: There is no project, or its file of volumes is damaged.
    """
    return len(read_volumes(folders.project_of(scene).volumes_file).get(name, []))


def add(scene: bpy.types.Scene, name: str, shape: bpy.types.Object, kind: str) -> None:
    """Let an object be `inside` or `outside` of a mesh, or of an Empty's box, as that stands now.

    Raises:
        KarfError: The shape is neither, or there is no rig.
        OSError: The file cannot be written.
    """
    known = read_volumes(folders.project_of(scene).volumes_file)
    _write(scene, known | {name: [*known.get(name, []), _volume(scene, shape, kind)]})


def clear(scene: bpy.types.Scene, name: str) -> None:
    """Take an object's volumes away; raises as `add`."""
    known = read_volumes(folders.project_of(scene).volumes_file)
    _write(scene, {other: volumes for other, volumes in known.items() if other != name})


def _volume(scene: bpy.types.Scene, shape: bpy.types.Object, kind: str) -> Volume:
    if scene.karf.rig is None:
        raise BadRequest("The scene has no captured cameras.", "Import a capture first.")
    to_capture = scene.karf.rig.matrix_world.inverted() @ shape.matrix_world
    if shape.type == "EMPTY":
        return Volume(kind, np.array(to_capture @ Matrix.Scale(shape.empty_display_size, 4)))
    if shape.type != "MESH":
        raise BadRequest(
            "{name!r} is neither a mesh nor an Empty.", "Select a mesh, or an Empty for its box.", name=shape.name
        )
    evaluated = shape.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.array([to_capture @ vertex.co for vertex in mesh.vertices])
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles])
    evaluated.to_mesh_clear()
    if len(vertices) < 4:
        raise BadRequest("{name!r} has no volume.", "Select a mesh with a volume.", name=shape.name)
    return Volume(kind, None, vertices, triangles)


def _write(scene: bpy.types.Scene, objects: dict[str, list[Volume]]) -> None:
    """Write the volumes as a step that undo takes back."""
    project = folders.project_of(scene)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / project.volumes_file.name
        write_volumes(made, objects)
        content = made.read_bytes() if objects else None
    history.record(scene, project.folder, {project.volumes_file: content})
