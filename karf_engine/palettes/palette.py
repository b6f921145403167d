"""Palettes, edits of palettes, and their files palette.json and edit.json.

Colors are display-referred sRGB, in [0, 1] as learned and in [0, MAX_SRGB] as edited. Entry 0 of every palette is
black and stays black.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_array, check_choice, check_fields
from ..io.color import to_bytes
from ..io.files import read_json, write_json
from ..io.names import check_name, check_names, find_normalized
from .edge_shape import MAX_CHOKE, MAX_FEATHER, EdgeShape, active_edges

PALETTE_SCHEMA, EDIT_SCHEMA = "karf-palette/1", "karf-edit/1"
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

    Raises BadRequest if the colors have the wrong shape, are not finite or are out of range, or the name is empty.

    Example:
        Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0]], np.float32))
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
    """Additional swatch of an object for one of its pigments; see `palettes.added`."""

    picked: np.ndarray  # the pigment's color as learned, sRGB [3] in [0, 1]; not black
    reach: float = REACH  # width of the hue gate around it, in (0, MAX_REACH]; 1 is the width that *Becomes* uses
    protect: float = 0.0  # share of its saturation below which colors are excluded as neutral, in [0, MAX_PROTECT]


@dataclass(frozen=True)
class Edit:
    """Edited palettes of all objects, with their compositing mode, added colors and edge shapes.

    Attributes:
        colors: Edited palette of every object by name, [M, 3] sRGB in [0, 2]. A added colors append their sets:
            [M (1 + A), 3].
        compositing: `delta` or `paper` (see `palettes.compositing`).
        added: Added colors by object name.
        edges: Edge shapes by object name; other objects keep their edges.

    Raises BadRequest if colors have the wrong shape, are not finite or are out of range, or the compositing is unknown.

    Examples:
        >>> Edit({"pot": np.stack([hex_to_rgb("#000000"), hex_to_rgb("#3059b8")])})
        Edit(delta: pot #000000 #3059b8)
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
    """Raise BadRequest unless an edit has exactly the objects and numbers of colors of these palettes."""
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
    """Return sRGB [3] float32 in [0, 1] of `#rrggbb`, # optional; raise DataError for other text."""
    match = re.fullmatch(r"#?([0-9a-fA-F]{6})", text.strip())
    if match is None:
        raise DataError(f"{text!r:.200} is not a color.", "Write it as #rrggbb, for example #aa2211.")
    return np.frombuffer(bytes.fromhex(match[1]), np.uint8).astype(np.float32) / np.float32(255)


def rgb_to_hex(color: np.ndarray) -> str:
    """Return `#rrggbb` of an sRGB color [3], clipped to [0, 1] and rounded."""
    return "#" + to_bytes(color).tobytes().hex()


def read_palettes(path: Path, which: str = "colors", objects: Sequence[str] | None = None) -> tuple[Palette, ...]:
    """Read one palette per object from palette.json: as learned (`colors`) or as extracted (`initial`).

    objects: names of the segmented objects, which the file must match in this order. Raises DataError if the file is
    missing, has another schema, an invalid name or color, or other objects.
    """
    content = _read_schema(path, "palettes", PALETTE_SCHEMA)
    palettes = []
    for entry in _list_of(content.get("objects"), f"{path}: 'objects'", MAX_OBJECTS):
        name = check_name(entry.get("name") if isinstance(entry, dict) else None, path, "an object")
        where = f"{path}: palette of {name!r}"
        colors = np.stack([color_of(c, where, 1) for c in _list_of(entry.get(which), where, MAX_COLORS)])
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
    """Write palette.json atomically: palettes as learned, and as extracted (`initial`, by default the same)."""
    initial = palettes if initial is None else initial
    objects = [
        {"name": palette.name, "colors": _rows_of(palette.colors), "initial": _rows_of(first.colors)}
        for palette, first in zip(palettes, initial, strict=True)
    ]
    write_json(path, {"schema": PALETTE_SCHEMA, "shared": shared, "objects": objects})


@check_arguments
def read_edit(path: Path | str, palettes: Sequence[Palette], compositing: str = "delta") -> Edit:
    """Read edit.json; null entries and missing objects stay as learned.

    palettes: as learned, one per object. compositing: default for files without one, `delta` or `paper`.

    Raises DataError if the file is missing or has another schema, an unknown object, a wrong number of colors, an
    invalid color, a changed black or an invalid edge.

    Example:
        edit = read_edit("night.json", model.palettes)
    """
    check_choice("compositing", compositing, COMPOSITING_MODES)
    return edit_from_json(_read_schema(Path(path), "edit", EDIT_SCHEMA), path, palettes, compositing)


def edit_from_json(
    content: dict[str, Any], path: Path | str, palettes: Sequence[Palette], compositing: str = "delta"
) -> Edit:
    """Parse the content of edit.json, with its schema already checked; otherwise like `read_edit`. path: for messages."""
    compositing = content.get("compositing", compositing)
    if compositing not in COMPOSITING_MODES:
        raise DataError(f"{path} has compositing {compositing!r:.200}.", f"Use one of {', '.join(COMPOSITING_MODES)}.")
    objects = content.get("objects", {})
    if not isinstance(objects, dict):
        raise DataError(f"{path}: 'objects' is not a table of objects.", 'Write {"name": {"colors": [...]}}.')
    colors, added, edges = {palette.name: palette.colors.copy() for palette in palettes}, {}, {}
    for written, entry in objects.items():
        name = find_normalized(written, colors)
        if name not in colors:
            raise DataError(f"{path} edits the unknown object {name!r:.200}.", f"Objects are: {', '.join(colors)}.")
        where = f"{path}: edit of {name!r}"
        entries = _list_of(entry.get("colors") if isinstance(entry, dict) else None, where, MAX_COLORS)
        if len(entries) != len(colors[name]):
            raise DataError(
                f"{where} has {len(entries)} colors, its palette has {len(colors[name])}.",
                "Give one color per swatch, black first; null leaves a swatch as it is.",
            )
        for index, value in enumerate(entries):
            if value is not None:
                colors[name][index] = color_of(value, where, MAX_SRGB)
        if colors[name][0].any():
            raise DataError(f"{where} changes entry 0.", "Entry 0 is black and frozen; write null or #000000 there.")
        if "added" in entry:
            sets = [
                _added(each, where, len(entries)) for each in _list_of(entry["added"], f"{where}: 'added'", MAX_ADDED)
            ]
            added[name] = tuple(each for each, _ in sets)
            colors[name] = np.concatenate([colors[name], *(own for _, own in sets)])
        if "edges" in entry:
            edges[name] = _edge(entry["edges"], where)
    return Edit(colors, compositing, added, active_edges(edges))


def _edge(entry: Any, where: str) -> EdgeShape:
    if not isinstance(entry, dict):
        raise DataError(f"{where} has the edges {entry!r:.200}.", 'Write {"choke": pixels, "feather": pixels}.')
    values = {}
    for key, low, high in (("choke", -MAX_CHOKE, MAX_CHOKE), ("feather", 0.0, MAX_FEATHER)):
        value = entry.get(key, 0.0)
        if not _is_number(value) or not low <= value <= high:
            raise DataError(f"{where} has the {key} {value!r:.200}.", f"Write pixels from {low:g} to {high:g}.")
        values[key] = float(value)
    return EdgeShape(**values)


def _added(entry: Any, where: str, size: int) -> tuple[AddedColor, np.ndarray]:
    """Parse an added color and its set [size, 3], the wanted color first."""
    if not isinstance(entry, dict):
        raise DataError(f"{where} has the added color {entry!r:.200}.", "Add colors again, and save the edit.")
    reach, protect = entry.get("reach", REACH), entry.get("protect", 0.0)
    colors = _list_of(entry.get("colors"), f"{where}: an added color", MAX_COLORS)
    if not _is_number(reach) or not 0 < reach <= MAX_REACH:
        raise DataError(f"{where} has the reach {reach!r:.200}.", f"Write a number above 0, up to {MAX_REACH:g}.")
    if not _is_number(protect) or not 0 <= protect <= MAX_PROTECT:
        raise DataError(f"{where} protects {protect!r:.200}.", f"Write a number from 0 to {MAX_PROTECT:g}.")
    if len(colors) != size:
        raise DataError(
            f"{where} has an added color of {len(colors)} colors, its palette has {size}.",
            "Give the wanted color, then one color per swatch.",
        )
    picked = color_of(entry.get("picked"), where, 1)
    return AddedColor(picked, float(reach), float(protect)), np.stack(
        [color_of(value, where, MAX_SRGB) for value in colors]
    )


@check_arguments
def write_edit(path: Path | str, edit: Edit) -> None:
    """Write edit.json atomically, with exact sRGB numbers; raise BadRequest for another suffix.

    Example:
        write_edit("night.json", model.edit().becomes("pot", "#803020", "#305980"))
    """
    check_choice("The suffix of path", Path(path).suffix.lower(), (".json",))
    write_json(Path(path), edit_to_json(edit))


def edit_to_json(edit: Edit) -> dict[str, Any]:
    """Return the content of edit.json."""
    objects: dict[str, dict[str, Any]] = {}
    for name, colors in edit.colors.items():
        added = edit.added.get(name, ())
        palette, *sets = np.split(np.asarray(colors), 1 + len(added))
        objects[name] = {"colors": _rows_of(palette)}
        if added:
            objects[name]["added"] = [_added_to_json(each, own) for each, own in zip(added, sets, strict=True)]
    for name, shape in active_edges(edit.edges).items():
        objects[name]["edges"] = asdict(shape)
    return {"schema": EDIT_SCHEMA, "compositing": edit.compositing, "objects": objects}


def _added_to_json(color: AddedColor, own: np.ndarray) -> dict[str, Any]:
    protect = {"protect": float(color.protect)} if color.protect else {}
    return {"picked": _rows_of(color.picked[None])[0], "reach": float(color.reach), **protect, "colors": _rows_of(own)}


def _read_schema(path: Path, what: str, schema: str) -> dict[str, Any]:
    content = read_json(path, what)
    found = content.get("schema") if isinstance(content, dict) else None
    if found != schema:
        raise DataError(f"{path} ({what}) has schema {found!r:.200}, not {schema}.", "Update KaRF, or write it again.")
    return content


def _list_of(value: Any, where: str, most: int) -> list:
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise DataError(f"{where} is not a list of 1 to {most} entries.", "Write a list, black first.")
    return value


def color_of(value: Any, where: str, highest: float) -> np.ndarray:
    """Parse a hex text or three numbers in [0, highest] into sRGB [3] float32; raise DataError for anything else."""
    if isinstance(value, str):
        try:
            return hex_to_rgb(value)
        except DataError as error:
            raise DataError(f"{where}: {error.sentence}", error.hint) from error
    if not isinstance(value, list) or len(value) != 3 or not all(_is_number(v) and 0 <= v <= highest for v in value):
        hint = f"Write #rrggbb or three sRGB numbers from 0 to {highest:g}."
        raise DataError(f"{where} has the color {value!r:.200}.", hint)
    return np.array(value, np.float32)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rows_of(colors: np.ndarray) -> list[list[float]]:
    """Return colors [n, 3] as JSON rows: the shortest decimals that read back as the same float32."""
    return [[float(str(v)) for v in row] for row in np.asarray(colors, np.float32)]
