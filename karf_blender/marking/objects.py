"""The objects that can be marked: a list in the scene, folders on the disk."""

from pathlib import Path

import bpy

from ..engine_api import file_name, find_normalized, first_case_collision, masks_of_view
from ..pictures.tints import tints_of
from ..project import captures, folders
from ..swatches import object_masks
from . import history

FIRST = "object"
BACKGROUND = "background"  # the engine's name for what no mask covers


def masks_folder(scene: bpy.types.Scene) -> Path:
    """Where masks are kept, one folder an object: the chosen one, else the project's; it may not exist yet.

    Raises:
        BadRequest: There is no project.
        DataError: It is a link that leads out of the project.
    """
    if not scene.karf.masks:
        return folders.project_of(scene).masks_folder
    folder = folders.absolute(scene.karf.masks)
    project = folders.project_of(scene) if scene.karf.project else None
    if project and folder.is_relative_to(project.folder):
        return project.path(*folder.relative_to(project.folder).parts)
    return folder


def corrections_folder(scene: bpy.types.Scene) -> Path:
    """Where strokes that correct the segmentation are kept, one folder an object.

    Raises:
        BadRequest: There is no project.
    """
    return folders.project_of(scene).corrections_folder


def active(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """The object that is being marked."""
    marking = scene.karf.marking
    return marking.objects[marking.active] if 0 <= marking.active < len(marking.objects) else None


def sync(scene: bpy.types.Scene) -> None:
    """Add the objects that the folder of masks and the project's palettes have and the list lacks."""
    marking = scene.karf.marking
    folder = masks_folder(scene)
    found = sorted(path.name for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    for name in [*found, *scene.karf.objects.keys()]:
        if find_normalized(name, marking.objects.keys()) not in marking.objects and not name.startswith("."):
            _append(scene, name)


def restart(scene: bpy.types.Scene) -> None:
    """Another project was chosen: the list is of its objects, and of those that the folder of masks has."""
    items, folder = scene.karf.marking.objects, masks_folder(scene)
    for number in reversed(range(len(items))):
        if not (folder / items[number].folder).is_dir() and items[number].folder not in scene.karf.objects:
            items.remove(number)
    scene.karf.marking.active = 0
    sync(scene)


def add(scene: bpy.types.Scene, name: str = FIRST) -> bpy.types.PropertyGroup:
    """Add an object by a name as people type them, and make it the active one."""
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
    """The color of an object's overlay, sRGB."""
    names = [other.folder for other in item.id_data.karf.marking.objects]
    return tints_of(names, object_masks.numbers_of(item.id_data))[item.folder]


def usable_name(name: str, others: list[str]) -> str:
    """The name, as close as a folder can have it on every system and no other object has it already.

    Examples: `red flower` stays; `a/b` becomes `a_b`; a second `pot` or `Pot` becomes `pot 2`.
    """
    name = file_name(name.strip() or FIRST).strip()
    if name.startswith(".") or name.casefold() == BACKGROUND:
        name = f"_{name}"
    made, number = name, 1
    while first_case_collision([*others, made]) or made in others:
        number += 1
        made = f"{name} {number}"
    return made


def rename(scene: bpy.types.Scene, item: bpy.types.PropertyGroup) -> None:
    """The list's name of an object was changed: its files follow, and the name becomes one that a folder can have.

    Raises:
        OSError: A file cannot be moved.
    """
    others = [other.folder for other in scene.karf.marking.objects if other != item]
    name, old = usable_name(item.name, others), item.folder
    if name != old and scene.karf.project:
        for root in (masks_folder(scene), corrections_folder(scene)):
            _move(scene, root, old, name)
    item["name"] = item.folder = name


def _move(scene: bpy.types.Scene, root: Path, old: str, name: str) -> None:
    files = {path: path.read_bytes() for path in (root / old).rglob("*") if path.is_file()}
    moved = {root / name / path.relative_to(root / old): content for path, content in files.items()}
    if files:
        history.record(scene, root, {**moved, **dict.fromkeys(files)})


def remove(scene: bpy.types.Scene) -> None:
    """Take the active object off the list, and its masks and corrections off the disk.

    Raises:
        OSError: A file cannot be removed.
    """
    marking, item = scene.karf.marking, active(scene)
    for root in (masks_folder(scene), corrections_folder(scene)):
        files = [path for path in (root / item.folder).rglob("*") if path.is_file()]
        if files:
            history.record(scene, root, dict.fromkeys(files))
    marking.objects.remove(marking.active)
    marking.active = max(0, min(marking.active, len(marking.objects) - 1))


def marked_views(scene: bpy.types.Scene) -> list[str]:
    """The views in which the active object has a mask or a correction, in the capture's order.

    Raises:
        KarfError: There is no capture.
    """
    item = active(scene)
    if item is None:
        return []
    roots = [root / item.folder for root in (masks_folder(scene), corrections_folder(scene))]
    views = captures.of(scene).views
    return [view.name for view in views if any(masks_of_view(root, view) for root in roots)]
