"""Edits in palette files of other programs: GIMP's `.gpl`, Adobe's swatch exchange `.ase`, and our JSON.

Reading is in `named_colors`. A swatch is named `<object> <number>`, from 1; black is not written. Both foreign formats
are limited to white, `.gpl` to 8 bits per channel, and neither stores added colors or edge shapes.
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
    """Write an edit atomically: `.gpl` and `.ase` as palette, `.json` as edit.json.

    Palettes clip colors brighter than white.

    Raises:
        BadRequest: The suffix is unknown, or the file is a palette and the edit has added colors.

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
    """Read an edit of the learned palettes from edit.json (see `read_edit`) or a palette file, `.gpl` or `.ase`.

    Colors of a palette file are assigned to swatches by name, such as `pot 1`. If no name matches, they are assigned in
    order, provided that their number matches.

    Raises:
        DataError: The file is missing, damaged or too large, or its colors match the swatches neither by name nor by
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
    """Assign the file's colors to swatches; return palettes [M, 3] by object name."""
    swatches = {
        _swatch_name(palette.name, index): (palette.name, index)
        for palette in palettes
        for index in range(1, len(palette.colors))
    }
    names = [entry.name for entry in entries]
    if not set(names) & set(swatches):
        if len(names) != len(swatches):
            raise DataError(
                f"{path} has {len(names)} colors, none of which is named after a swatch; there are {len(swatches)} "
                "swatches.",
                f"Name the colors {', '.join(list(swatches)[:2])} .., or give one for each swatch in that order.",
            )
        names = list(swatches)
    wrong = next((name for number, name in enumerate(names) if name not in swatches or name in names[:number]), None)
    if wrong is not None:
        problem = "twice a color" if wrong in swatches else "a color"
        raise DataError(
            f"{path} has {problem} named {wrong!r:.100}.",
            f"Swatches are: {', '.join(swatches)}; name each at most once.",
        )
    colors = {palette.name: palette.colors.copy() for palette in palettes}
    for name, entry in zip(names, entries, strict=True):
        object_name, index = swatches[name]
        colors[object_name][index] = np.clip(entry.color, 0, 1)  # Lab colors may be beyond sRGB
    return colors


def _swatch_name(object_name: str, index: int) -> str:
    return f"{object_name} {index}"


# --- .gpl: text, one color per line ---------------------------------------------------------------------------------
def _write_gpl(path: Path, palettes: Mapping[str, np.ndarray]) -> None:
    lines = [GPL_HEAD, f"Name: {path.stem}", "#"]
    for name, colors in palettes.items():
        for index, color in enumerate(to_bytes(colors[1:]).tolist(), 1):
            lines.append("{:3} {:3} {:3}\t{}".format(*color, _swatch_name(name, index)))
    _write_bytes(path, "".join(f"{line}\n" for line in lines).encode())


# --- .ase: blocks of big-endian numbers and UTF-16 names --------------------------------------------------------------
def _write_ase(path: Path, palettes: Mapping[str, np.ndarray]) -> None:
    blocks = []
    for name, colors in palettes.items():
        blocks.append(_ase_block(ASE_GROUP, _ase_text(name)))
        for index, color in enumerate(np.clip(colors[1:], 0, 1), 1):
            value = struct.pack(">4s3fH", b"RGB ", *map(float, color), 0)  # 0: a global color
            blocks.append(_ase_block(ASE_COLOR, _ase_text(_swatch_name(name, index)) + value))
        blocks.append(_ase_block(ASE_END, b""))
    _write_bytes(path, ASE_HEAD + struct.pack(">I", len(blocks)) + b"".join(blocks))


def _ase_block(kind: int, content: bytes) -> bytes:
    return struct.pack(">HI", kind, len(content)) + content


def _ase_text(text: str) -> bytes:
    """Encode a text after its length in UTF-16 units, terminator included."""
    encoded = text.encode("utf-16-be") + b"\0\0"
    return struct.pack(">H", len(encoded) // 2) + encoded


def _write_bytes(path: Path, data: bytes) -> None:
    def write(temporary: Path) -> None:
        temporary.write_bytes(data)

    atomic_write(path, write)
