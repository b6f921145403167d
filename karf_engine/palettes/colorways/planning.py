"""Plan the colorways of a learned project: their edits and predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...errors import BadRequest, DataError
from ...project.folder import Project
from ..calibration import ReferenceLight
from ..color_histogram import read_object_colors
from ..edge_shape import EdgeShape
from ..palette import Edit, read_palettes
from ..palette_files import read_edit_file
from .prediction import Prediction, predict
from .sheet import Colorway, read_sheet


@dataclass(frozen=True)
class PlannedColorway:
    """Edit of a colorway, before rendering.

    Attributes:
        colorway: As in the sheet.
        edit: Edit of all objects; those not in the colorway stay as learned.
        predictions: One per target color; none if the colorway is an edit.
    """

    colorway: Colorway
    edit: Edit
    predictions: tuple[Prediction, ...]


def plan_colorways(
    project: Project,
    sheet: Path,
    locked: Mapping[str, Sequence[int]] | None = None,
    light: ReferenceLight | None = None,
    edges: Mapping[str, EdgeShape] | None = None,
) -> tuple[PlannedColorway, ...]:
    """Plan the colorways of a sheet (see `palettes.colorways.sheet`).

    Args:
        project: A project with palettes.
        sheet: CSV or JSON.
        locked: Swatches that stay as learned, by object; ignored for colorways that are edits.
        light: Reference light of the sheet's colors; None if they are as in the photos. Predictions are as in the
            photos.
        edges: Edge shapes by object; ignored for colorways that are edits.

    Raises:
        BadRequest: The project has no palettes, or a locked swatch is unknown.
        DataError: The sheet is invalid, names an unknown object or an edit of other palettes, or a project file is
            damaged.
    """
    project.require("palette")
    palettes = {palette.name: palette for palette in read_palettes(project.verified(project.palette_file))}
    locked = locked or {}
    for name, numbers in locked.items():
        for number in numbers:
            if name not in palettes or not 0 <= number < len(palettes[name].colors):
                raise BadRequest(
                    f"There is no swatch {number} of {name!r} to lock.", f"Objects are: {', '.join(palettes)}."
                )
    colorways = read_sheet(sheet)
    for colorway in colorways:
        for target in colorway.target_colors:
            if target.name not in palettes:
                raise DataError(
                    f"{target.where}: there is no object {target.name!r}.", f"Objects are: {', '.join(palettes)}."
                )
    path = project.verified(project.object_colors_file)
    seen = {name: read_object_colors(path, name) for name in palettes}
    learned = {name: palette.colors for name, palette in palettes.items()}
    planned = []
    for colorway in colorways:
        if colorway.edit is not None:
            planned.append(PlannedColorway(colorway, read_edit_file(colorway.edit, tuple(palettes.values())), ()))
            continue
        predictions = []
        for target in colorway.target_colors:
            if light is not None:
                target = replace(target, lab=light.lab_photographed(target.lab))
            predictions.append(predict(target, palettes[target.name], seen[target.name], locked.get(target.name, ())))
        colors = learned | {prediction.target_color.name: prediction.colors for prediction in predictions}
        edit = Edit(colors, "delta", edges=dict(edges or {}))
        planned.append(PlannedColorway(colorway, edit, tuple(predictions)))
    return tuple(planned)
