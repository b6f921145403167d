"""Palettes, edits of palettes, and palette.json (edit.json: `edit_files`).

Colors are display-referred sRGB, in [0, 1] as learned and in [0, BRIGHTEST] as edited. Entry 0 of every palette is
black and stays black.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_array, check_choice, check_fields
from ..io.color import to_bytes
from ..io.files import read_json, write_json
from ..io.names import check_name, check_names
from .edge_shape import EdgeShape

PALETTE_SCHEMA = "karf-palette/1"
COMPOSITING_MODES = ("delta", "paper")
MAX_OBJECTS, MAX_COLORS = 255, 64
MAX_ADDED = 16  # per object
REACH, MAX_REACH = 0.5, 4.0  # of an added color: default and maximum
PROTECT, MAX_PROTECT = 0.1, 0.5  # less recolors reflections, more leaves rims of the old color
MAX_SRGB = 2.0  # highest sRGB value of an edited color: swatches may exceed white, mixtures are clipped


@dataclass(frozen=True)
class Palette:
    """Palette of one object.

    Attributes:
        name: The object's name.
        colors: [M, 3] float32 sRGB in [0, 1]; entry 0 is black and frozen.

    Raises:
        BadRequest: The colors have the wrong shape, are not finite or are out of range, or the name is empty.

    Examples:
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0]], np.float32))
        >>> [rgb_to_hex(color) for color in pot.colors]
        ['#000000', '#804000']
    """

    name: str
    colors: np.ndarray

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.name:
            raise BadRequest("A palette's name is empty.", "Name its object.")
        _check_colors(self.name, self.colors, 1)

    def __repr__(self) -> str:
        return f"Palette({_brief(self.name, self.colors)})"


@dataclass(frozen=True)
class AddedColor:
    """Additional swatch of an object for one of its pigments; see `palettes.added`.

    Attributes:
        picked: The pigment's color as learned, sRGB [3] in [0, 1]; not black.
        reach: Width of the hue gate around it, in (0, MAX_REACH]; 1 is the width that *Becomes* uses.
        protect: Share of its saturation below which colors are neutral and excluded, in [0, MAX_PROTECT]; see
            `matching.paints.pigment_gate`.
    """

    picked: np.ndarray
    reach: float = REACH
    protect: float = 0.0


@dataclass(frozen=True)
class Edit:
    """Edited palettes of all objects, with their compositing mode, added colors and edge shapes.

    Attributes:
        colors: Edited palette of every object by name, [M, 3] sRGB in [0, BRIGHTEST]. A added colors append their sets:
            [M (1 + A), 3].
        compositing: `delta` or `paper` (see `palettes.compositing`).
        added: Added colors by object name.
        edges: Edge shapes by object name; other objects keep their edges.

    Raises:
        BadRequest: Colors have the wrong shape, are not finite or are out of range, or the compositing is unknown.

    Examples:
        >>> edit = Edit({"pot": np.stack([hex_to_rgb("#000000"), hex_to_rgb("#3059b8")])})
        >>> edit.compositing, rgb_to_hex(edit.colors["pot"][1])
        ('delta', '#3059b8')
    """

    colors: dict[str, np.ndarray]
    compositing: str = "delta"
    added: dict[str, tuple[AddedColor, ...]] = field(default_factory=dict)
    edges: dict[str, EdgeShape] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        check_choice("compositing", self.compositing, COMPOSITING_MODES)
        for name, colors in self.colors.items():
            _check_colors(name, colors, MAX_SRGB)

    def __repr__(self) -> str:
        objects = ", ".join(_brief(name, colors) for name, colors in self.colors.items())
        return f"{type(self).__name__}({self.compositing}: {objects})"


def check_edit(edit: Edit, palettes: Sequence[Palette]) -> None:
    """Raise BadRequest unless an edit has exactly the objects and numbers of colors of these palettes.

    Examples:
        >>> check_edit(Edit({}), [Palette("pot", np.zeros((2, 3)))])
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: The edit is of no object, the palettes are of pot. Make it by model.edit().
    """
    names = [palette.name for palette in palettes]
    if set(edit.colors) != set(names) or not {*edit.added, *edit.edges} <= set(names):
        other = ", ".join(dict.fromkeys([*edit.colors, *edit.added, *edit.edges])) or "no object"
        raise BadRequest(
            f"The edit is of {other:.200}, the palettes are of {', '.join(names):.200}.", "Make it by model.edit()."
        )
    for palette in palettes:
        size, given = len(palette.colors), len(edit.colors[palette.name])
        wanted = size * (1 + len(edit.added.get(palette.name, ())))
        if given != wanted:
            raise BadRequest(
                f"The edit has {given} colors of {palette.name!r}, its palette {wanted}.", "Make it by model.edit()."
            )


def _brief(name: str, colors: np.ndarray) -> str:
    return f"{name} {' '.join(map(rgb_to_hex, colors))}"


def _check_colors(name: str, colors: np.ndarray, highest: float) -> None:
    check_array(f"colors of {name!r}", colors, ("M", 3))
    if not len(colors) or not ((colors >= 0) & (colors <= highest)).all():
        raise BadRequest(
            f"colors of {name!r} are none, not finite, or not within 0 and {highest:g}.", "Give sRGB numbers, [M, 3]."
        )


def hex_to_rgb(text: str) -> np.ndarray:
    """Return sRGB [3] float32 in [0, 1] of `#rrggbb`; the # is optional.

    Raises:
        DataError: The text is not such a color.

    Examples:
        >>> print(hex_to_rgb("#ff0033"))
        [1.  0.  0.2]
    """
    match = re.fullmatch(r"#?([0-9a-fA-F]{6})", text.strip())
    if match is None:
        raise DataError(f"{text!r:.200} is not a color.", "Write it as #rrggbb, for example #aa2211.")
    return np.frombuffer(bytes.fromhex(match[1]), np.uint8).astype(np.float32) / np.float32(255)


def rgb_to_hex(color: np.ndarray) -> str:
    """Return `#rrggbb` of an sRGB color [3], clipped to [0, 1] and rounded.

    Examples:
        >>> rgb_to_hex(np.array([1.5, 0.0, 0.2]))
        '#ff0033'
    """
    return "#" + to_bytes(color).tobytes().hex()


def read_palettes(path: Path, which: str = "colors", objects: Sequence[str] | None = None) -> tuple[Palette, ...]:
    """Read palette.json.

    Args:
        path: The file.
        which: `colors` for the palettes as learned, `initial` as extracted.
        objects: Names of the segmented objects, which the file must match in this order; None accepts any.

    Returns:
        One palette per object.

    Raises:
        DataError: The file is missing, has another schema, an invalid name or color, or other objects.

    Examples:
        >>> import tempfile
        >>> pot, black = (Palette("pot", np.array([[0, 0, 0], [red, 0, 0]], np.float32)) for red in (1, 0))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_palettes(Path(folder) / "palette.json", [pot], shared=False, initial=[black])
        ...     rgb_to_hex(read_palettes(Path(folder) / "palette.json")[0].colors[1])
        '#ff0000'
    """
    content = read_schema(path, "palettes", PALETTE_SCHEMA)
    palettes = []
    for entry in list_of(content.get("objects"), f"{path}: 'objects'", MAX_OBJECTS):
        name = check_name(entry.get("name") if isinstance(entry, dict) else None, path, "an object")
        where = f"{path}: palette of {name!r}"
        colors = np.stack([color_of(c, where, 1) for c in list_of(entry.get(which), where, MAX_COLORS)])
        if colors[0].any():
            raise DataError(f"{where} does not begin with black.", "Entry 0 is black and frozen; put [0, 0, 0] there.")
        palettes.append(Palette(name, colors))
    names = check_names([palette.name for palette in palettes], path, "an object")
    if objects is not None and names != list(objects):
        raise DataError(
            f"{path} holds palettes of {', '.join(names):.200}, the segmentation {', '.join(objects):.200}.",
            "Run the palette stage again.",
        )
    return tuple(palettes)


def write_palettes(
    path: Path, palettes: Sequence[Palette], shared: bool, initial: Sequence[Palette] | None = None
) -> None:
    """Write palette.json atomically: palettes as learned, and as extracted (`initial`, by default the same).

    `shared` records whether all objects share one hull.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_palettes(Path(folder) / "palette.json", [Palette("pot", np.zeros((2, 3)))], shared=False)
        ...     read_palettes(Path(folder) / "palette.json")
        (Palette(pot #000000 #000000),)
    """
    initial = palettes if initial is None else initial
    objects = [
        {"name": palette.name, "colors": rows_of(palette.colors), "initial": rows_of(first.colors)}
        for palette, first in zip(palettes, initial, strict=True)
    ]
    write_json(path, {"schema": PALETTE_SCHEMA, "shared": shared, "objects": objects})


def read_schema(path: Path, what: str, schema: str) -> dict[str, Any]:
    """Read a JSON file and check its schema; raise DataError if it is missing or has another.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_json(Path(folder) / "a.json", {"schema": "karf-edit/1"})
        ...     read_schema(Path(folder) / "a.json", "edit", "karf-edit/1")
        {'schema': 'karf-edit/1'}
    """
    content = read_json(path, what)
    found = content.get("schema") if isinstance(content, dict) else None
    if found != schema:
        raise DataError(f"{path} ({what}) has schema {found!r:.200}, not {schema}.", "Update KaRF, or write it again.")
    return content


def list_of(value: Any, where: str, most: int) -> list:
    """Return `value` if it is a list of 1 to `most` entries, otherwise raise DataError.

    Examples:
        >>> list_of(["#ff0000"], "edit.json", 2)
        ['#ff0000']
    """
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise DataError(f"{where} is not a list of 1 to {most} entries.", "Write a list, black first.")
    return value


def color_of(value: Any, where: str, highest: float) -> np.ndarray:
    """Parse a hex text or three numbers in [0, highest] into sRGB [3] float32; raise DataError for anything else.

    Examples:
        >>> color_of("#ff0000", "edit.json", 1).tolist(), color_of([0, 1.5, 0], "edit.json", 2).tolist()
        ([1.0, 0.0, 0.0], [0.0, 1.5, 0.0])
    """
    if isinstance(value, str):
        try:
            return hex_to_rgb(value)
        except DataError as error:
            raise DataError(f"{where}: {error.sentence}", error.hint) from error
    if not isinstance(value, list) or len(value) != 3 or not all(is_number(v) and 0 <= v <= highest for v in value):
        hint = f"Write #rrggbb or three sRGB numbers from 0 to {highest:g}."
        raise DataError(f"{where} has the color {value!r:.200}.", hint)
    return np.array(value, np.float32)


def is_number(value: Any) -> bool:
    """Return whether a JSON value is a number; bool is an int in Python, but not a number here.

    Examples:
        >>> is_number(1), is_number(True), is_number("1")
        (True, False, False)
    """
    return isinstance(value, int | float) and not isinstance(value, bool)


def rows_of(colors: np.ndarray) -> list[list[float]]:
    """Return colors [n, 3] as JSON rows: the shortest decimals that read back as the same float32.

    Examples:
        >>> rows_of(np.array([[0, 0.1, 1]], np.float32))
        [[0.0, 0.1, 1.0]]
    """
    return [[float(str(v)) for v in row] for row in np.asarray(colors, np.float32)]
