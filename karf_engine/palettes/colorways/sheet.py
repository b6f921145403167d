"""Read sheets of colorways: CSV or JSON files of target colors per object and colorway.

A row has a `colorway`, an `object`, and one color in a column of its kind (see `color_text`). The object's color to be
replaced may be given as `source_hex`, `source_lab`, `source_srgb` or `source_srgb8`. Instead of object and color, a
row may have an edit or palette file in the column `edit`, relative to the sheet's folder; the colorway then is this
edit. Other columns are ignored. A JSON sheet is a list of rows with the same keys.
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
from ..color_text import KINDS, color_of_row, csv_rows

MAX_ROWS = 10_000


@dataclass(frozen=True)
class TargetColor:
    """Target color of one object in a colorway.

    Attributes:
        name: The object's name.
        lab: The target color, CIE L*a*b* [3].
        source: The object's color in the photos to be replaced, sRGB [3]; None for the dominant one.
        where: File and line, for messages.
    """

    name: str
    lab: np.ndarray
    source: np.ndarray | None
    where: str


@dataclass(frozen=True)
class Colorway:
    """Target colors of objects, or the file of an edit.

    Attributes:
        name: As written.
        target_colors: One per object; none for an edit.
        edit: File of the edit.
    """

    name: str
    target_colors: tuple[TargetColor, ...]
    edit: Path | None = None

    @property
    def folder(self) -> str:
        """The name as a folder name."""
        return file_name(self.name)


def read_sheet(path: Path) -> tuple[Colorway, ...]:
    """Read a sheet: JSON by suffix, otherwise CSV with commas, semicolons or tabs.

    Returns:
        The colorways, in order of first occurrence.

    Raises:
        DataError: The file is missing or not a sheet, a row is incomplete or has an invalid color, or a colorway has
            two target colors for one object, two edits, or both.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "spring.csv"
        ...     _ = path.write_text("colorway,object,hex\\nMint,pot,#80d0a0\\nSky,pot,#80a0d0\\n")
        ...     [(colorway.name, colorway.target_colors[0].lab.round().tolist()) for colorway in read_sheet(path)]
        [('Mint', [77.0, -35.0, 16.0]), ('Sky', [65.0, 1.0, -28.0])]
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
        target_color = _target_color(row, where)
        if target_color.name in target_colors:
            raise DataError(
                f"{where}: {name!r} has two colors of {target_color.name!r}.",
                f"The other is {target_colors[target_color.name].where}.",
            )
        target_colors[target_color.name] = target_color
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


def _target_color(row: dict[str, Any], where: str) -> TargetColor:
    name = _text(row, "object", where)
    lab = color_of_row(row, where)
    if lab is None:
        raise DataError(f"{where} has no color.", f"Fill one of the columns {', '.join(KINDS)}.")
    source = color_of_row(row, where, "source_")
    return TargetColor(name, lab, None if source is None else np.clip(lab_to_srgb(source), 0, 1), where)
