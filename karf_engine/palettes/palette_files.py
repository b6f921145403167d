"""Edits in the palette files of other programs: GIMP's `.gpl`, Adobe's swatch exchange `.ase`, and our own JSON.

They are read by `palettes.named_colors`. A swatch is called `<object> <number>`, from 1; black is not written. Both
formats end at white; `.gpl` has 8 bits a channel. Neither can record what an added color was picked for, so these are kept
in JSON alone; so are the shapes of edges.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_choice
from ..io.color import to_bytes
from ..io.files import atomic_write
from .edit_files import read_edit, write_edit
from .named_colors import ASE_COLOR, ASE_END, ASE_GROUP, ASE_HEAD, GPL_HEAD, NamedColor, read_named_colors
from .palette import Edit, Palette

SUFFIXES = (".json", ".gpl", ".ase")


def write_edit_file(path: Path, edit: Edit) -> None:
    """Write the colors of an edit, atomically: as a palette for `.gpl` and `.ase`, for `.json` as edit.json.

    Colors brighter than white are clipped in palettes, and kept in JSON.

    Raises:
        BadRequest: The file is of another kind, or is a palette and the edit has added colors.

    Examples:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "pots.gpl"
        ...     write_edit_file(path, Edit({"pot": np.array([[0, 0, 0], [1.5, 0.2, 0]])}))
        ...     print(path.read_text())
        GIMP Palette
        Name: pots
        #
        255  51   0	pot 1
    """
    check_choice("The suffix", path.suffix.lower(), SUFFIXES)
    write = {".gpl": _write_gpl, ".ase": _write_ase}.get(path.suffix.lower())
    if write is None:
        write_edit(path, edit)
        return
    if edit.added:
        raise BadRequest(
            f"{path.name} cannot hold the colors that were added to {', '.join(edit.added)}.", "Save a .json file."
        )
    write(path, edit.colors)


def read_edit_file(path: Path, palettes: Sequence[Palette], compositing: str = "delta") -> Edit:
    """Read an edit of the learned palettes from edit.json or a palette file.

    Colors of a palette file go to the swatches that they name, `pot 1`; where no name is a swatch's, in their
    order, when there are as many of them as swatches.

    Args:
        path: The file; `.gpl` and `.ase` are palettes.
        palettes: As learned, one an object.
        compositing: What a file that names none means, `delta` or `paper`.

    Raises:
        DataError: The file is missing, damaged or too large, or its colors fit the swatches neither by name nor by
            number.

    Examples:
        >>> import tempfile
        >>> pot = Palette("pot", np.array([[0, 0, 0], [0.5, 0.25, 0]], np.float32))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "pots.ase"
        ...     write_edit_file(path, Edit({"pot": np.array([[0, 0, 0], [0, 0.25, 1]])}))
        ...     read_edit_file(path, [pot]).colors["pot"].tolist()
        [[0.0, 0.0, 0.0], [0.0, 0.25, 1.0]]
    """
    if path.suffix.lower() not in (".gpl", ".ase"):
        return read_edit(path, palettes, compositing)
    return Edit(_assigned(path, read_named_colors(path), palettes), compositing)


def _assigned(path: Path, entries: Sequence[NamedColor], palettes: Sequence[Palette]) -> dict[str, np.ndarray]:
    """Palettes [M, 3] by the object's name, with the file's colors at their swatches."""
    places = {
        swatch_name(palette.name, index): (palette.name, index)
        for palette in palettes
        for index in range(1, len(palette.colors))
    }
    names = [entry.name for entry in entries]
    if not set(names) & set(places):
        if len(names) != len(places):
            raise DataError(
                f"{path} has {len(names)} colors, none of which is named after a swatch; there are {len(places)} "
                "swatches.",
                f"Name the colors {', '.join(list(places)[:2])} .., or give one for each swatch in that order.",
            )
        names = list(places)
    wrong = next((name for number, name in enumerate(names) if name not in places or name in names[:number]), None)
    if wrong is not None:
        problem = "twice a color" if wrong in places else "a color"
        raise DataError(
            f"{path} has {problem} named {wrong!r:.100}.", f"Swatches are: {', '.join(places)}; name each at most once."
        )
    colors = {palette.name: palette.colors.copy() for palette in palettes}
    for name, entry in zip(names, entries, strict=True):
        object_name, index = places[name]
        colors[object_name][index] = np.clip(entry.color, 0, 1)  # Lab colors may be beyond sRGB
    return colors


def swatch_name(object_name: str, index: int) -> str:
    """What a swatch is called in other programs.

    Examples:
        >>> swatch_name("pot", 1)
        'pot 1'
    """
    return f"{object_name} {index}"


# --- .gpl: text, a color a line ------------------------------------------------------------------------------------
def _write_gpl(path: Path, palettes: Mapping[str, np.ndarray]) -> None:
    lines = [GPL_HEAD, f"Name: {path.stem}", "#"]
    for name, colors in palettes.items():
        for index, color in enumerate(to_bytes(colors).tolist()):
            if index:
                lines.append("{:3} {:3} {:3}\t{}".format(*color, swatch_name(name, index)))
    text = "\n".join(lines) + "\n"
    atomic_write(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


# --- .ase: blocks of big-endian numbers and UTF-16 names --------------------------------------------------------------
def _write_ase(path: Path, palettes: Mapping[str, np.ndarray]) -> None:
    blocks = []
    for name, colors in palettes.items():
        blocks.append(_ase_block(ASE_GROUP, _ase_text(name)))
        for index, color in enumerate(np.clip(colors, 0, 1)):
            if index:
                value = struct.pack(">4s3fH", b"RGB ", *map(float, color), 0)  # 0: a global color
                blocks.append(_ase_block(ASE_COLOR, _ase_text(swatch_name(name, index)) + value))
        blocks.append(_ase_block(ASE_END, b""))
    data = ASE_HEAD + struct.pack(">I", len(blocks)) + b"".join(blocks)
    atomic_write(path, lambda temporary: temporary.write_bytes(data))


def _ase_block(kind: int, content: bytes) -> bytes:
    return struct.pack(">HI", kind, len(content)) + content


def _ase_text(text: str) -> bytes:
    """A text with its length in units of two bytes before it, the zero at its end counted."""
    encoded = text.encode("utf-16-be") + b"\0\0"
    return struct.pack(">H", len(encoded) // 2) + encoded
