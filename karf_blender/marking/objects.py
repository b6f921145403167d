"""The objects to mark: a list in the scene, folders of masks and corrections on the disk, volumes that bound them."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ..engine_api import (
    BadRequest,
    Volume,
    file_name,
    find_normalized,
    first_case_collision,
    masks_of_view,
    read_volumes,
    write_volumes,
)
from ..pictures.tints import tints_of
from ..project import captures, folders
from ..swatches import object_masks
from . import history

FIRST = "object"
BACKGROUND = "background"  # the engine's name for what no mask covers


def masks_folder(scene: bpy.types.Scene) -> Path:
    """Return the chosen folder with one folder of masks for each object, else the project's; it may not exist yet.

    Raises KarfError without a project, or if a link leads out of it.
    """
    folder = folders.place_of(scene, "masks")
    if folder is None:
        return folders.project_of(scene).masks_folder
    project = folders.project_of(scene) if scene.karf.project else None
    if project and folder.is_relative_to(project.folder):
        return project.path(*folder.relative_to(project.folder).parts)
    return folder


def mark_folders(scene: bpy.types.Scene) -> tuple[Path, Path]:
    """Return the folders of masks and of corrections, each with one folder for each object; raises like `masks_folder`."""
    return masks_folder(scene), folders.project_of(scene).corrections_folder


def active(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    marking = scene.karf.marking
    return marking.objects[marking.active] if 0 <= marking.active < len(marking.objects) else None


def sync(scene: bpy.types.Scene) -> None:
    """Add missing objects of the folder of masks and the project's palettes to the list."""
    marking = scene.karf.marking
    folder = masks_folder(scene)
    found = sorted(path.name for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    for name in [*found, *scene.karf.objects.keys()]:
        if find_normalized(name, marking.objects.keys()) not in marking.objects and not name.startswith("."):
            _append(scene, name)


def restart(scene: bpy.types.Scene) -> None:
    """Reduce the list to the objects of a newly chosen project and of the folder of masks."""
    items, folder = scene.karf.marking.objects, masks_folder(scene)
    for number in reversed(range(len(items))):
        if not (folder / items[number].folder).is_dir() and items[number].folder not in scene.karf.objects:
            items.remove(number)
    scene.karf.marking.active = 0
    sync(scene)


def add(scene: bpy.types.Scene, name: str = FIRST) -> bpy.types.PropertyGroup:
    """Add an object by a name that a user types, and make it active."""
    item = _append(scene, usable_name(name, scene.karf.marking.objects.keys()))
    scene.karf.marking.active = len(scene.karf.marking.objects) - 1
    return item


def _append(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    items = scene.karf.marking.objects
    taken = {other.number for other in items}
    item = items.add()
    item.number = next(number for number in range(len(items)) if number not in taken)
    item["name"] = item.folder = name  # by key: no update, which would rename the folder
    return item


def tint(item: bpy.types.PropertyGroup) -> tuple[float, float, float]:
    """Return the color of an object's overlay, sRGB."""
    names = [other.folder for other in item.id_data.karf.marking.objects]
    return tints_of(names, object_masks.numbers_of(item.id_data))[item.folder]


def usable_name(name: str, others: list[str]) -> str:
    """Return the closest name for a folder on every system: `a/b` becomes `a_b`, a second `pot` or `Pot` `pot 2`."""
    name = file_name(name.strip() or FIRST).strip()
    if name.startswith(".") or name.casefold() == BACKGROUND:
        name = f"_{name}"
    made, number = name, 1
    while first_case_collision([*others, made]) or made in others:
        number += 1
        made = f"{name} {number}"
    return made


def rename(scene: bpy.types.Scene, item: bpy.types.PropertyGroup) -> None:
    """Move an object's files after a change of its name in the list, and make that usable. Raises OSError."""
    others = [other.folder for other in scene.karf.marking.objects if other != item]
    name, old = usable_name(item.name, others), item.folder
    if name != old and scene.karf.project:
        for root in mark_folders(scene):
            files = {path: path.read_bytes() for path in (root / old).rglob("*") if path.is_file()}
            moved = {root / name / path.relative_to(root / old): content for path, content in files.items()}
            if files:
                history.record(scene, root, {**moved, **dict.fromkeys(files)})
    item["name"] = item.folder = name


def remove(scene: bpy.types.Scene) -> None:
    """Remove the active object from the list, and its masks and corrections from the disk. Raises OSError."""
    marking, item = scene.karf.marking, active(scene)
    for root in mark_folders(scene):
        files = [path for path in (root / item.folder).rglob("*") if path.is_file()]
        if files:
            history.record(scene, root, dict.fromkeys(files))
    marking.objects.remove(marking.active)
    marking.active = max(0, min(marking.active, len(marking.objects) - 1))


def marked_views(scene: bpy.types.Scene) -> list[str]:
    """Return the views with a mask or correction of the active object, in the capture's order."""
    item = active(scene)
    if item is None:
        return []
    roots = [root / item.folder for root in mark_folders(scene)]
    return [view.name for view in captures.of(scene).views if any(masks_of_view(root, view) for root in roots)]


# --- volumes -------------------------------------------------------------------------------------------------------
def set_volume(scene: bpy.types.Scene, name: str, shape: bpy.types.Object | None, kind: str) -> int:
    """Require an object to be `inside` or `outside` of a mesh or an Empty's box in its current place.

    Without a shape, its volumes are removed. Returns their number. Raises KarfError if the shape is neither mesh nor
    Empty, or without a rig; OSError if the file cannot be written.
    """
    project = folders.project_of(scene)
    known = read_volumes(project.volumes_file)
    if shape is None:
        known.pop(name, None)
    else:
        known[name] = [*known.get(name, []), _volume(scene, shape, kind)]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / project.volumes_file.name
        write_volumes(made, known)
        content = made.read_bytes() if known else None
    history.record(scene, project.folder, {project.volumes_file: content})
    return len(known.get(name, []))


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
