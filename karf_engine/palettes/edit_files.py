"""Read and write edit.json: the edited swatches, added colors and edge shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..io.arguments import check_arguments, check_choice
from ..io.files import write_json
from ..io.names import find_normalized
from .edge_shape import MAX_CHOKE, MAX_FEATHER, EdgeShape, active_edges
from .palette import (
    COMPOSITING_MODES,
    MAX_ADDED,
    MAX_COLORS,
    MAX_PROTECT,
    MAX_REACH,
    MAX_SRGB,
    REACH,
    AddedColor,
    Edit,
    Palette,
    color_of,
    is_number,
    list_of,
    read_schema,
    rows_of,
)

EDIT_SCHEMA = "karf-edit/1"


@check_arguments
def read_edit(path: Path | str, palettes: Sequence[Palette], compositing: str = "delta") -> Edit:
    """Read edit.json; null entries and missing objects stay as learned.

    Args:
        path: The file.
        palettes: As learned, one per object.
        compositing: Default for files without one, `delta` or `paper`.

    Raises:
        DataError: The file is missing or has another schema, an unknown object, a wrong number of colors, an invalid
            color, a changed black or an invalid edge.

    Examples:
        >>> import tempfile
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0], [1, 1, 1]], np.float32))
        >>> text = '{"schema": "karf-edit/1", "objects": {"pot": {"colors": [null, "#0000ff", null]}}}'
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "edit.json"
        ...     _ = path.write_text(text)
        ...     edit = read_edit(path, [pot])
        >>> edit.compositing, edit.colors["pot"].tolist()
        ('delta', [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    """
    check_choice("compositing", compositing, COMPOSITING_MODES)
    return edit_from_json(read_schema(Path(path), "edit", EDIT_SCHEMA), path, palettes, compositing)


def edit_from_json(
    content: dict[str, Any], path: Path | str, palettes: Sequence[Palette], compositing: str = "delta"
) -> Edit:
    """Parse the content of edit.json, with its schema already checked; otherwise like `read_edit`.

    `path` is the file, or another name for messages.

    Examples:
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.9, 0.1, 0.1]]))
        >>> edit_from_json({"objects": {"pot": {"colors": [None, "#0000ff"]}}}, "the query", [pot]).colors["pot"][1]
        array([0., 0., 1.])
    """
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
        entries = list_of(entry.get("colors") if isinstance(entry, dict) else None, where, MAX_COLORS)
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
                _added(each, where, len(entries)) for each in list_of(entry["added"], f"{where}: 'added'", MAX_ADDED)
            ]
            added[name] = tuple(each for each, _ in sets)
            colors[name] = np.concatenate([colors[name], *(own for _, own in sets)])
        if "edges" in entry:
            edges[name] = _edge(entry["edges"], where)
    return Edit(colors, compositing, added, active_edges(edges))


def _edge(entry: Any, where: str) -> EdgeShape:
    """Parse an edge shape; missing values are 0."""
    if not isinstance(entry, dict):
        raise DataError(f"{where} has the edges {entry!r:.200}.", 'Write {"choke": pixels, "feather": pixels}.')
    values = {}
    for key, low, high in (("choke", -MAX_CHOKE, MAX_CHOKE), ("feather", 0.0, MAX_FEATHER)):
        value = entry.get(key, 0.0)
        if not is_number(value) or not low <= value <= high:
            raise DataError(f"{where} has the {key} {value!r:.200}.", f"Write pixels from {low:g} to {high:g}.")
        values[key] = float(value)
    return EdgeShape(**values)


def _added(entry: Any, where: str, size: int) -> tuple[AddedColor, np.ndarray]:
    """Parse an added color and its set [size, 3], the wanted color first."""
    if not isinstance(entry, dict):
        raise DataError(f"{where} has the added color {entry!r:.200}.", "Add colors again, and save the edit.")
    reach, protect = entry.get("reach", REACH), entry.get("protect", 0.0)
    colors = list_of(entry.get("colors"), f"{where}: an added color", MAX_COLORS)
    if not is_number(reach) or not 0 < reach <= MAX_REACH:
        raise DataError(f"{where} has the reach {reach!r:.200}.", f"Write a number above 0, up to {MAX_REACH:g}.")
    if not is_number(protect) or not 0 <= protect <= MAX_PROTECT:
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

    Examples:
        >>> import tempfile
        >>> from .palette import rgb_to_hex
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0]], np.float32))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_edit(Path(folder) / "edit.json", Edit({"pot": np.array([[0, 0, 0], [0, 0.1, 1.5]])}, "paper"))
        ...     again = read_edit(Path(folder) / "edit.json", [pot])
        >>> again.compositing, rgb_to_hex(again.colors["pot"][1])
        ('paper', '#001aff')
    """
    check_choice("The suffix of path", Path(path).suffix.lower(), (".json",))
    write_json(Path(path), edit_to_json(edit))


def edit_to_json(edit: Edit) -> dict[str, Any]:
    """Return the content of edit.json.

    Examples:
        >>> edit = Edit({"pot": np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])}, "delta", {})
        >>> edit_to_json(edit)["objects"]
        {'pot': {'colors': [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]}}
    """
    objects: dict[str, dict[str, Any]] = {}
    for name, colors in edit.colors.items():
        added = edit.added.get(name, ())
        palette, *sets = np.split(np.asarray(colors), 1 + len(added))
        objects[name] = {"colors": rows_of(palette)}
        if added:
            objects[name]["added"] = [_added_to_json(each, own) for each, own in zip(added, sets, strict=True)]
    for name, shape in active_edges(edit.edges).items():
        objects[name]["edges"] = asdict(shape)
    return {"schema": EDIT_SCHEMA, "compositing": edit.compositing, "objects": objects}


def _added_to_json(color: AddedColor, own: np.ndarray) -> dict[str, Any]:
    protect = {"protect": float(color.protect)} if color.protect else {}
    return {"picked": rows_of(color.picked[None])[0], "reach": float(color.reach), **protect, "colors": rows_of(own)}
