"""Sheets of colorways: a CSV or JSON file that says which object of which colorway gets which color.

A row has a colorway's name, an object, and one color in a column that names its kind:

    hex                 #rrggbb
    lab                 CIE L* a* b* (D65), three numbers; or the three columns L*, a*, b*
    srgb                sRGB numbers from 0 to 1
    srgb8               sRGB numbers from 0 to 255; or the three columns R, G, B

The color of the object that is to become it may stand in `source_hex`, `source_lab`, `source_srgb` or `source_srgb8`.
In place of an object and a color a row may name an edit or palette file in the column `edit`, its path from the sheet's
folder: then the colorway is that edit. Other columns are left alone. A JSON sheet is a list of rows with the same keys.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...io.color import lab_to_srgb
from ...io.files import read_json
from ...io.names import file_name
from ..color_rows import KINDS, color_of_row, csv_rows

MOST_ROWS = 10_000


@dataclass(frozen=True)
class TargetColor:
    """The color that one object of a colorway is to have.

    Attributes:
        name: The object's.
        lab: The wanted color, CIE L*a*b* [3].
        source: The color of the object, as photos show it, that is to become it, sRGB [3]; None for its dominant one.
        where: Its file and line, for messages.
    """

    name: str
    lab: np.ndarray
    source: np.ndarray | None
    where: str


@dataclass(frozen=True)
class Colorway:
    """Objects and the colors that they are to have together.

    Attributes:
        name: As written.
        target_colors: One for each object; none where it is an edit.
        edit: The file of the edit that it is.
    """

    name: str
    target_colors: tuple[TargetColor, ...]
    edit: Path | None = None

    @property
    def folder(self) -> str:
        """The name as that of a folder."""
        return file_name(self.name)


def read_sheet(path: Path) -> tuple[Colorway, ...]:
    """Read a sheet, JSON by its suffix, else CSV (commas, semicolons or tabs).

    Args:
        path: The file.

    Returns:
        The colorways in the order in which they begin.

    Raises:
        DataError: The file is missing or not a sheet, a row lacks something or has an invalid color, or a colorway has
            two target colors of one object, two edits, or both.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "spring.csv"
        ...     _ = path.write_text("colorway,object,hex\\nMint,pot,#80d0a0\\nSky,pot,#80a0d0\\n")
        ...     [(colorway.name, colorway.target_colors[0].lab.round().tolist()) for colorway in read_sheet(path)]
        [('Mint', [77.0, -35.0, 16.0]), ('Sky', [65.0, 1.0, -28.0])]
    """
    rows = list(_json_rows(path) if path.suffix.lower() == ".json" else csv_rows(path))
    if not 0 < len(rows) <= MOST_ROWS:
        raise DataError(f"{path} has {len(rows)} rows of colorways.", f"Give 1 to {MOST_ROWS}.")
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
        target_color = _target_color(row, where)
        if target_color.name in target_colors:
            raise DataError(
                f"{where}: {name!r} has two colors of {target_color.name!r}.",
                f"The other is {target_colors[target_color.name].where}.",
            )
        target_colors[target_color.name] = target_color
    return tuple(Colorway(name, tuple(own.values()), edits.get(name)) for name, own in colors.items())


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


def _target_color(row: dict[str, Any], where: str) -> TargetColor:
    name = _text(row, "object", where)
    lab = color_of_row(row, where)
    if lab is None:
        raise DataError(f"{where} has no color.", f"Fill one of the columns {', '.join(KINDS)}.")
    source = color_of_row(row, where, "source_")
    return TargetColor(name, lab, None if source is None else np.clip(lab_to_srgb(source), 0, 1), where)
