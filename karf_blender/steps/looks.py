"""Steps 4 and 5: named looks, whole states of the swatches: in all views, as colorways of a sheet are, or as a web page."""

from collections.abc import Mapping
from pathlib import Path

import bpy

from .. import progress
from ..engine_api import (
    BadRequest,
    Edit,
    Message,
    PlannedColorway,
    choose_views,
    file_name,
    plan_colorways,
    write_edit,
    write_json,
)
from ..project import captures, folders
from ..render_engine import camera_pixels
from ..swatches import colors, edits, looks, outputs
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
    """Write every look by the scene's File Names, as `colorways` does; `of_camera`: of the scene's camera's frames."""
    if not len(scene.karf.looks):
        raise BadRequest("The scene has no looks.", "Keep one first.")
    if "{look}" not in scene.karf.file_names:
        raise BadRequest("The pictures of all looks would have the same names.", "Add {look} to File Names.")
    out = Path(out).absolute() if out else looks_folder(scene, of_camera)
    if of_camera:
        views = str(export_cameras(scene, out / "cameras.json"))
    names = [view.name for view in choose_views(captures.of(scene), views)[0]]
    made_by = {look.name: looks.edit_of(look) for look in scene.karf.looks}
    free = {outputs.free_look(scene, out, names, [edit], look): edit for look, edit in made_by.items()}
    return colorways(scene, _write_looks(out, free), views, out, outputs.pattern_of(scene))


def _write_looks(folder: Path, edits: Mapping[str, Edit]) -> Path:
    """Write edits by name as a sheet of colorways; return its file."""
    rows = [{"colorway": name, "edit": f"edits/{file_name(name)}.json"} for name in edits]
    for row, edit in zip(rows, edits.values(), strict=True):
        write_edit(folder / row["edit"], edit)
    write_json(folder / "looks.json", rows)
    return folder / "looks.json"


def export_page(
    scene: bpy.types.Scene,
    out: str | Path | None = None,
    title: str = "",
    studio: str = "",
    logo: str | Path | None = None,
    single: bool = False,
) -> Task:
    """Write a web page with the scene's looks, or with the swatches as they are where it has none.

    Locked swatches are not offered. The task's result is the page's index.html.

    Args:
        out: a new or empty folder, or one with an earlier page.
        title: the page's heading; empty: the scene's name.
        studio: who made it.
        logo: a .png, .jpg, .webp or .svg.
        single: whether index.html has everything.
    """
    out, karf = Path(out).absolute() if out else page_folder(scene), scene.karf
    options = {"out": str(out), "title": title or scene.name, "studio": studio, "single": single}
    options |= {"locked": _locked_options(scene), "overrides": [f"render.unseen={camera_pixels.unseen(scene)}"]}
    if logo:
        options["logo"] = str(Path(logo).absolute())
    if karf.objects:
        shown = {look.name: looks.edit_of(look) for look in karf.looks} or {outputs.NOT_KEPT: edits.current_edit(scene)}
        options["sheet"] = str(_write_looks(folders.project_of(scene).path("page"), shown))
    finish = requests.presenting(lambda _: None, Message("The web page is in {path}.", path=out), out)
    return requests.task(
        scene, "Export Page", ("export-page", options), finish=finish, result=lambda: out / "index.html"
    )


def page_folder(scene: bpy.types.Scene) -> Path:
    """Where the web page goes, unless another folder is chosen."""
    return folders.out_folder(scene) / "page"


def looks_folder(scene: bpy.types.Scene, of_camera: bool = False) -> Path:
    """Where pictures of the looks go, in paths by the scene's File Names."""
    return camera_folder(scene) if of_camera else folders.out_folder(scene)


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


def _locked_options(scene: bpy.types.Scene) -> list[str]:
    return [f"{name}/{number}" for name, numbers in _locked(scene).items() for number in numbers]


def colorways(
    scene: bpy.types.Scene,
    sheet: str | Path,
    views: str = "all",
    out: str | Path | None = None,
    names: str = "{look}/{view}",
) -> Task:
    """Have the engine write every colorway of a sheet (docs/files.md) in every view, with a table and a contact sheet.

    The views are `all`, `train`, `test`, names and ranges with commas, or a camera file's path. Pictures that would come
    out the same are kept; `names` are their paths. The task's result is the colorways, each with its edit and the
    predicted colors.
    """
    sheet = Path(sheet).absolute()
    planned = predict_colorways(scene, sheet)  # a wrong sheet is reported now, and not by a job
    out = Path(out).absolute() if out else colorways_folder(scene, sheet)
    options = {"sheet": str(sheet), "views": views, "out": str(out), "names": names, "locked": _locked_options(scene)}
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
