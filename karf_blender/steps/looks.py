"""Steps 6 and 7: named looks, whole states of the swatches; each of them, or each colorway of a sheet, in all views."""

from pathlib import Path

import bpy

from .. import progress
from ..engine_api import BadRequest, PlannedColorway, plan_colorways, write_edit, write_json
from ..project import folders
from ..swatches import colors, looks
from ..tasks.runner import Task
from . import requests
from .render import camera_folder, export_cameras
from .swatches import save_edit


def keep_look(scene: bpy.types.Scene, name: str = "") -> str:
    """Keep the swatches as a look, new or replaced, and use it; return its name (default: the first free letter)."""
    requests.check_palettes(scene)
    name = name or looks.free_name(scene)
    if name not in scene.karf.looks:
        looks.check_name(scene, name)
    looks.keep(scene, name)
    return name


def flip_looks(scene: bpy.types.Scene) -> str:
    """Choose the look that was in use before this one, or else the next; returns its name."""
    name = looks.other(scene)
    if not name:
        raise BadRequest("There is no other look.", "Keep two looks to switch between them.")
    looks.choose(scene, name)
    return name


def remove_look(scene: bpy.types.Scene, name: str) -> None:
    """Remove a look; swatches stay as they are."""
    looks.named(scene, name)
    scene.karf.looks.remove(scene.karf.looks.find(name))


def move_look(scene: bpy.types.Scene, name: str, by: int) -> None:
    """Move a look down the list by some places; up where `by` is negative."""
    looks.named(scene, name)
    place, last = scene.karf.looks.find(name), len(scene.karf.looks) - 1
    scene.karf.looks.move(place, min(max(place + by, 0), last))


def render_looks(
    scene: bpy.types.Scene, views: str = "all", of_camera: bool = False, out: str | Path | None = None
) -> Task:
    """Write every look as `colorways` does, a folder each; `of_camera`: in the frames of the scene's camera."""
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


def predict_colorways(scene: bpy.types.Scene, sheet: str | Path) -> tuple[PlannedColorway, ...]:
    """Predict the colors of a sheet (under daylight with a gray card or chart) without the engine; locks hold."""
    sheet, light = Path(sheet).absolute(), colors.reference_light(scene)
    return plan_colorways(folders.project_of(scene), sheet, _locked(scene), light, colors.edges(scene))


def _locked(scene: bpy.types.Scene) -> dict[str, list[int]]:
    locked = {
        item.name: [i for i, swatch in enumerate(item.swatches[: colors.size(item)]) if swatch.locked]
        for item in scene.karf.objects
    }
    return {name: numbers for name, numbers in locked.items() if numbers}


def colorways(scene: bpy.types.Scene, sheet: str | Path, views: str = "all", out: str | Path | None = None) -> Task:
    """Have the engine write every colorway of a sheet (docs/files.md) in every view, with a table and a contact sheet.

    The views are `all`, `train`, `test`, names with commas, or the path of a camera file. Pictures that would come out
    the same are kept. The task's result is the colorways, each with its edit and the predicted colors.
    """
    sheet = Path(sheet).absolute()
    planned = predict_colorways(scene, sheet)  # a wrong sheet is reported now, and not by a job
    out = Path(out).absolute() if out else colorways_folder(scene, sheet)
    locked = [f"{name}/{number}" for name, numbers in _locked(scene).items() for number in numbers]
    options = {"sheet": str(sheet), "views": views, "out": str(out), "locked": locked}
    light = colors.reference_light(scene)
    if light is not None:
        options["light"] = light.matrix.ravel().tolist()
    if colors.edges(scene):
        edges = folders.project_of(scene).path("colorways_edges.json")
        save_edit(scene, edges)
        options["edges"] = str(edges)

    def finish(*_) -> None:
        progress.wrote(out)
        progress.warn("Colorways, their table and a contact sheet are in {out}.", out=out)

    return requests.task(scene, "Colorways", ("colorways", options), finish=finish, result=lambda: planned)


def colorways_folder(scene: bpy.types.Scene, sheet: Path) -> Path:
    """Where the colorways of a sheet go."""
    return folders.out_folder(scene) / "colorways" / sheet.stem
