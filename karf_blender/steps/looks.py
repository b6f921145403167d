"""Step 6: named looks, whole states of the swatches. Step 7: each of them rendered."""

from pathlib import Path

import bpy

from ..engine_api import BadRequest, write_edit, write_json
from ..project import folders
from ..swatches import looks
from ..tasks.runner import Task
from .cameras import export_cameras
from .colorways import colorways
from .render import camera_folder


def keep_look(scene: bpy.types.Scene, name: str = "") -> str:
    """Keep the swatches as they stand as a look, which is then in use.

    Args:
        scene: The scene.
        name: A new one, or the look to replace; empty: the first free letter.

    Returns:
        The look's name.

    Raises:
        BadRequest: There are no palettes, or the name is too like another look's.
    """
    if not scene.karf.objects:
        raise BadRequest("There is no palette yet.", "Extract the palettes first.")
    name = name or looks.free_name(scene)
    if name not in scene.karf.looks:
        looks.check_name(scene, name)
    looks.keep(scene, name)
    return name


def choose_look(scene: bpy.types.Scene, name: str) -> None:
    """Set all swatches to a look, locked ones too: a look is a whole state.

    Raises:
        BadRequest: There is no such look.
        DataError: What it keeps was spoiled.
    """
    looks.choose(scene, name)


def flip_looks(scene: bpy.types.Scene) -> str:
    """Choose the look that was in use before this one, else the next; returns its name. Raises BadRequest where there is
    none."""
    name = looks.other(scene)
    if not name:
        raise BadRequest("There is no other look.", "Keep two looks to switch between them.")
    looks.choose(scene, name)
    return name


def rename_look(scene: bpy.types.Scene, name: str, new: str) -> None:
    """Give a look another name. Raises BadRequest where there is no such look, or the name is too like another's."""
    looks.rename(scene, name, new)


def remove_look(scene: bpy.types.Scene, name: str) -> None:
    """Remove a look; swatches stay as they are. Raises BadRequest where there is none."""
    looks.named(scene, name)
    scene.karf.looks.remove(scene.karf.looks.find(name))


def move_look(scene: bpy.types.Scene, name: str, by: int) -> None:
    """Move a look down the list by so many places, or up. Raises BadRequest where there is none."""
    looks.named(scene, name)
    place, last = scene.karf.looks.find(name), len(scene.karf.looks) - 1
    scene.karf.looks.move(place, min(max(place + by, 0), last))


def render_looks(
    scene: bpy.types.Scene, views: str = "all", of_camera: bool = False, out: str | Path | None = None
) -> Task:
    """Have the engine write every look in every view, or in every frame of the scene's camera: a folder for each look.

    Pictures that are there already and would come out the same are kept.

    Args:
        scene: The scene.
        views: `all`, `train`, `test`, names with commas, or the path of a camera file.
        of_camera: In place of these, what the scene's camera sees in the scene's frames.
        out: The folder; default: `looks_folder`.

    Returns:
        The task; its result are the looks as colorways, each with its edit.

    Raises:
        BadRequest: There is no look, or no camera.
        DataError: What a look keeps was spoiled.
    """
    if not len(scene.karf.looks):
        raise BadRequest("The scene has no looks.", "Keep one first.")
    out = Path(out).absolute() if out else looks_folder(scene, of_camera)
    edits = {look.name: looks.edit_of(look) for look in scene.karf.looks}
    rows = [{"colorway": name, "edit": f"edits/{number}.json"} for number, name in enumerate(edits, 1)]
    for row, edit in zip(rows, edits.values(), strict=True):
        write_edit(out / row["edit"], edit)
    write_json(out / "looks.json", rows)
    if of_camera:
        views = str(export_cameras(scene, out / "cameras.json"))
    return colorways(scene, out / "looks.json", views, out)


def looks_folder(scene: bpy.types.Scene, of_camera: bool = False) -> Path:
    """Where pictures of the looks go: beside colorways, those of a camera beside its frames."""
    return camera_folder(scene) / "looks" if of_camera else folders.out_folder(scene) / "colorways" / "looks"
