"""Colors as text: `#rrggbb`, CSS's `color(srgb r g b)` beyond white, and rows of CSV tables.

Columns of a color in a table:
    hex    #rrggbb
    lab    CIE L* a* b* (D65), three numbers; or three columns L*, a*, b* (also L, a, b)
    srgb   sRGB numbers from 0 to 1
    srgb8  sRGB numbers from 0 to 255; or three columns R, G, B
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.color import srgb_to_lab
from ..io.files import MAX_JSON_BYTES, check_file
from .palette import MAX_SRGB, color_of, hex_to_rgb, rgb_to_hex

# CSS Color Module Level 4, 10.2; # is optional, as in color lists of web addresses
PATTERN = re.compile(r"color\(\s*srgb((?:\s+\d*\.?\d+){3})\s*\)|(?<![0-9a-z])#?([0-9a-f]{6})(?![0-9a-z])", re.I)
RANGES = {  # of the three numbers
    "lab": (np.array([0, -200, -200]), np.array([100, 200, 200])),
    "srgb": (np.zeros(3), np.ones(3)),
    "srgb8": (np.zeros(3), np.full(3, 255)),
}
KINDS = ("hex", *RANGES)
COLUMNS_OF_ONE = (("lab", ("l*", "a*", "b*")), ("lab", ("l", "a", "b")), ("srgb8", ("r", "g", "b")))
DELIMITERS = "\t;,"


def color_to_text(color: Sequence[float] | np.ndarray) -> str:
    """Format an sRGB color [3] in [0, MAX_SRGB]; colors up to white are rounded to 8 bits."""
    if max(color) <= 1:
        return rgb_to_hex(np.asarray(color))
    return "color(srgb {:.5g} {:.5g} {:.5g})".format(*map(float, color))


def colors_of_text(text: str) -> np.ndarray:
    """Parse all colors in a text, sRGB [n, 3] float32 in [0, MAX_SRGB]; other text is ignored."""
    found = [np.array(wide.split(), np.float32) if wide else hex_to_rgb(short) for wide, short in PATTERN.findall(text)]
    return np.clip(np.array(found, np.float32).reshape(-1, 3), 0, MAX_SRGB)


def csv_rows(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the non-empty rows of a CSV file, as cells by lower-case column name, with their location for messages.

    The file is UTF-8 with commas, semicolons or tabs, and a header row; DataError is raised otherwise.
    """
    check_file(path, MAX_JSON_BYTES)
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


def color_of_row(row: dict[str, Any], where: str, prefix: str = "") -> np.ndarray | None:
    """Parse the color of a row, cells by lower-case column name: CIE L*a*b* [3] (D65); None without a color.

    Column names have the `prefix`; only without one, a color may have three columns. Raises DataError, which names
    `where`, if two columns have a color, or a color is invalid.
    """
    if not prefix:
        for kind, parts in COLUMNS_OF_ONE:
            if all(str(row.get(part, "")).strip() for part in parts):
                row = row | {kind: [row[part] for part in parts]}
    filled = [kind for kind in KINDS if row.get(prefix + kind) not in (None, "") and str(row[prefix + kind]).strip()]
    if len(filled) > 1:
        raise DataError(f"{where} has a color as {' and as '.join(filled)}.", "Leave one of them.")
    if not filled:
        return None
    (kind,) = filled
    value = row[prefix + kind]
    if kind == "hex":
        return srgb_to_lab(color_of(str(value), where, 1))
    numbers = _three_numbers(value, kind, where)
    return numbers if kind == "lab" else srgb_to_lab(numbers / RANGES[kind][1])


def _three_numbers(value: Any, kind: str, where: str) -> np.ndarray:
    parts = _split(value) if isinstance(value, str) else value
    lowest, highest = RANGES[kind]
    try:
        numbers = np.array([float(part.replace(",", ".") if isinstance(part, str) else part) for part in parts])
        if numbers.shape == (3,) and ((numbers >= lowest) & (numbers <= highest)).all():
            return numbers
    except (TypeError, ValueError):
        pass
    limits = ", ".join(f"{low:g} to {high:g}" for low, high in zip(lowest, highest, strict=True))
    raise DataError(f"{where} has the {kind} color {value!r:.200}.", f"Give three numbers: {limits}.")


def _split(text: str) -> list[str]:
    """Split numbers at spaces or semicolons, as commas may be decimal; otherwise at commas."""
    parts = text.replace(";", " ").split()
    return [part.rstrip(",") for part in parts] if len(parts) > 1 else text.split(",")
