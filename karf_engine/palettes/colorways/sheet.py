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

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...io.color import lab_to_srgb, srgb_to_lab
from ...io.files import read_json
from ...io.inputs import MOST_JSON, check_file
from ...io.names import file_name
from ..palette import hex_to_rgb

MOST_ROWS = 10_000
RANGES = {  # lowest and highest value of the three numbers
    "lab": (np.array([0, -200, -200]), np.array([100, 200, 200])),
    "srgb": (np.zeros(3), np.ones(3)),
    "srgb8": (np.zeros(3), np.full(3, 255)),
}
KINDS = ("hex", *RANGES)
COLUMNS_OF_ONE = {"lab": ("l*", "a*", "b*"), "srgb8": ("r", "g", "b")}
DELIMITERS = "\t;,"


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
    rows = list(_json_rows(path) if path.suffix.lower() == ".json" else _csv_rows(path))
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


def _csv_rows(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    check_file(path, MOST_JSON)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except ValueError as error:
        raise DataError(f"{path} is not UTF-8 text.", "Export the sheet as CSV in UTF-8.") from error
    header = lines[0] if lines else ""
    reader = csv.DictReader(lines, delimiter=max(DELIMITERS, key=header.count))
    try:
        for row in reader:
            cells = {(key or "").strip().lower(): text for key, text in row.items() if isinstance(text, str)}
            if any(text.strip() for text in cells.values()):
                yield cells, f"{path}, line {reader.line_num}"
    except csv.Error as error:
        raise DataError(f"{path}, line {reader.line_num} is broken CSV: {error}.", "Export the sheet again.") from error


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
    joined = {kind: [row[part] for part in parts] for kind, parts in COLUMNS_OF_ONE.items() if _has_all(row, parts)}
    lab = _color(row | joined, "", where)
    if lab is None:
        raise DataError(f"{where} has no color.", f"Fill one of the columns {', '.join(KINDS)}.")
    source = _color(row, "source_", where)
    return TargetColor(name, lab, None if source is None else np.clip(lab_to_srgb(source), 0, 1), where)


def _has_all(row: dict[str, Any], columns: tuple[str, ...]) -> bool:
    return all(str(row.get(column, "")).strip() for column in columns)


def _color(row: dict[str, Any], prefix: str, where: str) -> np.ndarray | None:
    """The Lab color [3] in the columns that begin so; None where all are empty."""
    filled = [kind for kind in KINDS if row.get(prefix + kind) not in (None, "") and str(row[prefix + kind]).strip()]
    if len(filled) > 1:
        raise DataError(f"{where} has a color as {' and as '.join(filled)}.", "Leave one of them.")
    if not filled:
        return None
    (kind,) = filled
    value = row[prefix + kind]
    if kind == "hex":
        try:
            return srgb_to_lab(hex_to_rgb(str(value)))
        except DataError as error:
            raise DataError(f"{where}: {error.sentence}", error.hint) from error
    numbers = _three_numbers(value, kind, where)
    return numbers if kind == "lab" else srgb_to_lab(numbers / RANGES[kind][1])


def _three_numbers(value: Any, kind: str, where: str) -> np.ndarray:
    parts = _split(value) if isinstance(value, str) else value
    lowest, highest = RANGES[kind]
    try:
        numbers = np.array([float(part) if not isinstance(part, str) else _number(part) for part in parts])
        if numbers.shape == (3,) and ((numbers >= lowest) & (numbers <= highest)).all():
            return numbers
    except (TypeError, ValueError):
        pass
    limits = ", ".join(f"{low:g} to {high:g}" for low, high in zip(lowest, highest, strict=True))
    raise DataError(f"{where} has the {kind} color {value!r:.200}.", f"Give three numbers: {limits}.")


def _split(text: str) -> list[str]:
    """Numbers apart: by spaces or semicolons, so that their commas may be decimal ones; else by commas."""
    parts = text.replace(";", " ").split()
    return [part.rstrip(",") for part in parts] if len(parts) > 1 else text.split(",")


def _number(text: str) -> float:
    return float(text.strip().replace(",", "."))
