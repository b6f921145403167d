"""Colorways: sheets of target colors per object, CSV or JSON, and the edits and predictions planned from them.

A row has a `colorway`, an `object`, and one color in a column of its kind (see `color_text`). The object's color to be
replaced may be given as `source_hex`, `source_lab`, `source_srgb` or `source_srgb8`. Instead of object and color, a
row may have an edit or palette file in the column `edit`, relative to the sheet's folder; the colorway then is this
edit. Other columns are ignored. A JSON sheet is a list of rows with the same keys.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.color import lab_to_srgb
from ..io.files import read_json
from ..io.names import file_name
from ..project.folder import Project
from .calibration import ReferenceLight
from .color_histogram import read_object_colors
from .color_text import KINDS, color_of_row, csv_rows
from .edge_shape import EdgeShape
from .palette import Edit, Palette, read_palettes
from .palette_files import read_edit_file
from .prediction import Prediction, TargetColor, predict

MAX_ROWS = 10_000


@dataclass(frozen=True)
class Colorway:
    """Target colors of objects, or the file of an edit."""

    name: str  # as written
    target_colors: tuple[TargetColor, ...]  # one per object; none for an edit
    edit: Path | None = None  # file of the edit

    @property
    def folder(self) -> str:
        """The name as a folder name."""
        return file_name(self.name)


@dataclass(frozen=True)
class PlannedColorway:
    """Edit of a colorway, before rendering."""

    colorway: Colorway
    edit: Edit  # of all objects; those not in the colorway stay as learned
    predictions: tuple[Prediction, ...]  # one per target color


def plan_colorways(
    project: Project,
    sheet: Path,
    locked: Mapping[str, Sequence[int]] | None = None,  # swatches that stay as learned, by object
    light: ReferenceLight | None = None,  # of the sheet's colors; None if they are as in the photos
    edges: Mapping[str, EdgeShape] | None = None,  # by object
) -> tuple[PlannedColorway, ...]:
    """Plan the colorways of a sheet for a project with palettes.

    Locked swatches and edges do not count for colorways that are edits. Predictions are as in the photos.

    Raises BadRequest if the project has no palettes or a locked swatch is unknown, DataError if the sheet is invalid,
    names an unknown object or an edit of other palettes, or a project file is damaged.
    """
    project.require("palette")
    palettes = {palette.name: palette for palette in read_palettes(project.verified(project.palette_file))}
    locked = locked or {}
    check_locked(locked, palettes)
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


def check_locked(locked: Mapping[str, Sequence[int]], palettes: Mapping[str, Palette]) -> None:
    """Raise BadRequest for locked swatches, numbers by object, that no palette has."""
    for name, numbers in locked.items():
        for number in numbers:
            if name not in palettes or not 0 <= number < len(palettes[name].colors):
                raise BadRequest(
                    f"There is no swatch {number} of {name!r} to lock.", f"Objects are: {', '.join(palettes)}."
                )


def read_sheet(path: Path) -> tuple[Colorway, ...]:
    """Read a sheet, JSON by suffix, otherwise CSV: its colorways in order of first occurrence.

    Raises DataError if the file is missing or not a sheet, a row is incomplete or has an invalid color, or a colorway
    has two target colors for one object, two edits, or both.
    """
    rows = list(_json_rows(path) if path.suffix.lower() == ".json" else csv_rows(path))
    if not 0 < len(rows) <= MAX_ROWS:
        raise DataError(f"{path} has {len(rows)} rows of colorways.", f"Give 1 to {MAX_ROWS}.")
    colors: dict[str, dict[str, TargetColor]] = {}
    edits: dict[str, Path] = {}
    folders: dict[str, str] = {}
    for row, where in rows:
        name, edit = _text(row, "colorway", where), row.get("edit")
        same = folders.setdefault(file_name(name).casefold(), name)
        if same != name:
            raise DataError(f"{where}: {name!r} and {same!r} would share a folder.", "Give one of them another name.")
        target_colors = colors.setdefault(name, {})
        if name in edits or (edit and target_colors):
            raise DataError(
                f"{where}: {name!r} is an edit and has another row.", "Give an edit one row, and no colors."
            )
        if edit:
            edits[name] = path.parent / _text(row, "edit", where)
            continue
        object_name, lab = _text(row, "object", where), color_of_row(row, where)
        if lab is None:
            raise DataError(f"{where} has no color.", f"Fill one of the columns {', '.join(KINDS)}.")
        source = color_of_row(row, where, "source_")
        source = None if source is None else np.clip(lab_to_srgb(source), 0, 1)
        if object_name in target_colors:
            raise DataError(
                f"{where}: {name!r} has two colors of {object_name!r}.",
                f"The other is {target_colors[object_name].where}.",
            )
        target_colors[object_name] = TargetColor(object_name, lab, source, where)
    return tuple(Colorway(name, tuple(targets.values()), edits.get(name)) for name, targets in colors.items())


def _json_rows(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    rows = read_json(path, "colorways")
    if not isinstance(rows, list):
        raise DataError(
            f"{path} is not a list of rows.", 'Write [{"colorway": "Mint", "object": "pot", "hex": "#80d0a0"}].'
        )
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict):
            raise DataError(
                f"{path}, row {number} is {row!r:.200}.", 'Write {"colorway": .., "object": .., "hex": ..}.'
            )
        yield {key.lower(): value for key, value in row.items() if value is not None}, f"{path}, row {number}"


def _text(row: dict[str, Any], column: str, where: str) -> str:
    value = row.get(column)
    if not isinstance(value, str) or not value.strip():
        raise DataError(f"{where} has no {column}.", "A row has the columns colorway, object and a color.")
    return value.strip()
