"""Color books of ink and paint makers, and the names nearest to a color.

A book is a file of the user's: Adobe's `.acb` and `.ase`, GIMP's `.gpl`, or a CSV table with the column `name` and a
color (see `color_text`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_array, check_fields, check_number
from ..io.color import ciede2000, lab_to_srgb, srgb_to_lab
from ..io.files import refusing_unreadable
from .color_text import color_of_row, csv_rows
from .palette import rgb_to_hex
from .palette_files import READERS, read_named_colors

SUFFIXES = (*READERS, ".csv")
LONGEST = 100  # characters of a name
MAX_NAMES = 65_535  # limit of Adobe's color books


@dataclass(frozen=True, eq=False)
class ColorBook:
    """Named colors; `book["Sky"]` is a color by name, sRGB [3] float32, clipped to the gamut.

    Attributes:
        name: Name of the book.
        names: Unique names of n colors; case and spaces are ignored.
        lab: CIE L*a*b* [n, 3] (D65), possibly out of gamut.

    Raises BadRequest if names are missing, or colors have the wrong shape or are not finite.

    Examples:
        >>> book = ColorBook("paints", ("Traffic red", "Sky"), np.array([[41.0, 56, 42], [48.0, -14, -32]]))
        >>> print(book["traffic RED"].round(2))
        [0.72 0.16 0.12]
    """

    name: str
    names: tuple[str, ...]
    lab: np.ndarray

    def __post_init__(self) -> None:
        check_fields(self)
        check_array("lab", self.lab, ("n", 3))
        if not 0 < len(self.names) == len(self.lab) or not np.isfinite(self.lab).all():
            raise BadRequest("lab is not a color for each name.", "Give finite numbers, [n, 3], and n names.")

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {_key(name): number for number, name in enumerate(self.names)}

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> np.ndarray:
        return np.clip(lab_to_srgb(self.lab_of(name)), 0, 1).astype(np.float32)

    @check_arguments
    def lab_of(self, name: str) -> np.ndarray:
        """Return the CIE L*a*b* [3] (D65) of a name, possibly out of gamut; case and spaces are ignored.

        Raises BadRequest for an unknown name; the hint is the nearest one.
        """
        number = self._numbers.get(_key(name))
        if number is None:
            near = get_close_matches(_key(name), self._numbers, 1, 0)
            raise BadRequest(
                "{book} has no color {name!r}.",
                "Its nearest name is {near!r}.",
                book=self.name,
                name=name,
                near=self.names[self._numbers[near[0]]] if near else "",
            )
        return self.lab[number]


class NamedDifference(NamedTuple):
    """Name of a book, its sRGB [3] clipped to the gamut, and the CIEDE2000 of its unclipped color to another color."""

    name: str
    color: np.ndarray
    ciede2000: float


@check_arguments
def nearest_names(book: ColorBook, color: np.ndarray, count: int = 3) -> list[NamedDifference]:
    """Return at most `count` names whose colors are nearest to an sRGB color [3], the nearest first.

    Example:
        nearest_names(read_color_book("paints.acb"), np.array([0.5, 0.2, 0.1]))[0].name
    """
    check_array("color", color, (3,))
    check_number("count", count, 1)
    if not np.isfinite(color).all():
        raise BadRequest("color is not finite.", "Give three sRGB numbers.")
    difference = ciede2000(book.lab, srgb_to_lab(color))
    nearest = np.argsort(difference, kind="stable")[:count]
    shown = np.clip(lab_to_srgb(book.lab[nearest]), 0, 1)
    return [NamedDifference(book.names[n], each, float(difference[n])) for n, each in zip(nearest, shown, strict=True)]


@check_arguments
def read_color_book(path: Path | str) -> ColorBook:
    """Read a book, an `.acb`, `.ase` or `.gpl` file, or a table `.csv` with the columns `name` and `hex`, or `L`, `a`, `b`.

    Its name is that of the file. Lab of Adobe's files is adapted from D50 to D65. Repeated names are numbered; missing
    ones are `#rrggbb`.

    Raises DataError if the file is missing, damaged, too large, of another kind, in CMYK, or has no color.

    Example:
        read_color_book("paints.csv").names
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DataError("{path} is no color book.", "Choose a file of: {kinds}.", path=path, kinds=", ".join(SUFFIXES))
    with refusing_unreadable(path):
        if suffix == ".csv":
            entries = [_csv_entry(row, where) for row, where in csv_rows(path)]
        else:
            colors = read_named_colors(path)
            entries = [(_readable(name) or rgb_to_hex(color), srgb_to_lab(color)) for name, color in colors]
    if not 0 < len(entries) <= MAX_NAMES:
        raise DataError(
            "{path} has {count} colors.",
            "Choose a book of 1 to {most}.",
            path=path,
            count=len(entries),
            most=MAX_NAMES,
        )
    return ColorBook(path.stem, _unique(name for name, _ in entries), np.stack([lab for _, lab in entries]))


def _csv_entry(row: dict, where: str) -> tuple[str, np.ndarray]:
    name, lab = _readable(row.get("name", "")), color_of_row(row, where)
    if not name or lab is None:
        raise DataError(
            "{where} has no {what}.",
            "A row has the column name, and hex, or L, a and b.",
            where=where,
            what="color" if name else "name",
        )
    return name, lab


def _unique(names: Iterable[str]) -> tuple[str, ...]:
    found: dict[str, str] = {}
    repeats: dict[str, int] = {}
    for name in names:
        unique = name
        while _key(unique) in found:
            repeats[name] = repeats.get(name, 1) + 1
            unique = f"{name} ({repeats[name]})"
        found[_key(unique)] = unique
    return tuple(found.values())


def _readable(name: str) -> str:
    """Return a name on one line, shortened."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in name).split())[:LONGEST].strip()


def _key(name: str) -> str:
    return "".join(name.split()).casefold()
