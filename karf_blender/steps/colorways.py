"""Step 7: every colorway of a sheet in every view."""

from functools import partial
from pathlib import Path

import bpy

from .. import progress
from ..engine_api import Message, PlannedColorway, Request, plan_colorways
from ..project import folders
from ..swatches import colors, reference
from ..tasks.ownership import Owner
from ..tasks.runner import Task
from . import requests
from .edit import save_edit


def predict_colorways(scene: bpy.types.Scene, sheet: str | Path) -> tuple[PlannedColorway, ...]:
    """What each color of a sheet will be, without the engine; locked swatches stay. By a gray card or a
    color chart the sheet's colors are those under daylight.

    Raises:
        BadRequest: The scene has no project, or that has no palettes.
        DataError: The sheet has a row that is wrong, or a file of the project is damaged.
    """
    edges = colors.edges(scene)
    return plan_colorways(
        folders.project_of(scene), Path(sheet).absolute(), _locked(scene), reference.light(scene), edges
    )


def _locked(scene: bpy.types.Scene) -> dict[str, list[int]]:
    """Numbers of the locked swatches of each object that has some."""
    locked = {
        item.name: [i for i, swatch in enumerate(item.swatches[: colors.size(item)]) if swatch.locked]
        for item in scene.karf.objects
    }
    return {name: numbers for name, numbers in locked.items() if numbers}


def colorways(
    scene: bpy.types.Scene,
    sheet: str | Path,
    views: str = "all",
    out: str | Path | None = None,
) -> Task:
    """Have the engine write every colorway of a sheet in every view, with a table and a contact sheet.

    Pictures that are there already and would come out the same are kept.

    Args:
        scene: The scene.
        sheet: CSV or JSON: a colorway, an object and a color a row; see docs/files.md.
        views: `all`, `train`, `test`, names with commas, or the path of a camera file.
        out: The folder; default: `colorways_folder`.

    Returns:
        The task; its result is the colorways, each with its edit and the predicted colors.
    """
    sheet = Path(sheet).absolute()
    planned = predict_colorways(scene, sheet)  # a wrong sheet is told now, and not by a job
    out = Path(out).absolute() if out else colorways_folder(scene, sheet)
    locked = [f"{name}/{number}" for name, numbers in _locked(scene).items() for number in numbers]
    options = {"sheet": str(sheet), "views": views, "out": str(out), "locked": locked}
    light = reference.light(scene)
    if light is not None:
        options["light"] = light.matrix.ravel().tolist()
    if colors.edges(scene):
        edges = folders.project_of(scene).path("colorways_edges.json")
        save_edit(scene, edges)
        options["edges"] = str(edges)
    return requests.task(
        scene, "Colorways", ("colorways", options), finish=partial(_say_where, out), result=lambda: planned
    )


def colorways_folder(scene: bpy.types.Scene, sheet: Path) -> Path:
    """Where the colorways of a sheet go."""
    return folders.out_folder(scene) / "colorways" / sheet.stem


def _say_where(out: Path, owner: Owner, request: Request) -> None:
    del owner, request
    progress.wrote(out)
    progress.warn(Message("Colorways, their table and a contact sheet are in {out}.", out=out))
