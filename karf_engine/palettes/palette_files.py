"""Palette files of other programs: GIMP's `.gpl`, Adobe's swatch exchange `.ase` and color book `.acb`.

An edit is written as `.gpl` or `.ase`, or as our JSON. A swatch is named `<object> <number>`, from 1; black is not
written. Both foreign formats are limited to white, `.gpl` to 8 bits per channel, and neither stores added colors or
edge shapes.

The parsers follow GIMP's manual, Olivier Berten's list of palette formats, and Ates Goral's "Unofficial
Photoshop Color Book File Format Specification". Adobe's Lab (D50, as in ICC profiles) is adapted to D65.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import BadRequest, DataError
from ..io.arguments import check_choice
from ..io.color import lab_d50_to_d65, lab_to_srgb, to_bytes
from ..io.files import atomic_write, check_file, refusing_unreadable
from .palette import Edit, Palette, read_edit, write_edit

SUFFIXES = (".json", ".gpl", ".ase")
MOST_BYTES = 4 << 20  # several times the largest published book
GPL_HEAD = "GIMP Palette"
ASE_HEAD = b"ASEF\0\1\0\0"  # signature of a file of version 1.0
ASE_GROUP, ASE_END, ASE_COLOR = 0xC001, 0xC002, 0x0001  # block types
ASE_MODELS = {b"RGB ": 3, b"Gray": 1, b"LAB ": 3}  # supported color models and their numbers of channels
ACB_HEAD = b"8BCB"
ACB_RGB, ACB_CMYK, ACB_LAB = 0, 2, 7  # color spaces
ACB_SPACES = {1: "HSB", ACB_CMYK: "CMYK", 8: "gray"}  # unsupported ones
AGAIN = "Export the file again."


def write_edit_file(path: Path, edit: Edit) -> None:
    """Write an edit atomically: `.gpl` and `.ase` as palette, clipped to white, `.json` as edit.json.

    Raises BadRequest if the suffix is unknown, or the file is a palette and the edit has added colors.
    """
    suffix = path.suffix.lower()
    check_choice("The suffix", suffix, SUFFIXES)
    if suffix == ".json":
        write_edit(path, edit)
        return
    if edit.added:
        raise BadRequest(
            f"{path.name} cannot hold the colors that were added to {', '.join(edit.added)}.", "Save a .json file."
        )
    data = _gpl_bytes(path.stem, edit.colors) if suffix == ".gpl" else _ase_bytes(edit.colors)
    atomic_write(path, lambda temporary: temporary.write_bytes(data))


def read_edit_file(path: Path, palettes: Sequence[Palette], compositing: str = "delta") -> Edit:
    """Read an edit of the learned palettes from edit.json (see `read_edit`) or a palette file, `.gpl` or `.ase`.

    Colors of a palette file are assigned to swatches by name, such as `pot 1`; if no name matches, in order, provided
    that their number matches. Raises DataError otherwise, and if the file is missing, damaged or too large.
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


class NamedColor(NamedTuple):
    """Color of a palette file, sRGB [3]: float32 in [0, 1], or float64 and not clipped if the file is in Lab."""

    name: str
    color: np.ndarray


def read_named_colors(path: Path) -> list[NamedColor]:
    """Read the colors of a `.gpl`, `.ase` or `.acb` file, in order.

    Raises DataError if the file is missing, damaged or too large, or has a color model other than RGB, gray and Lab.
    """
    check_file(path, MOST_BYTES)
    with refusing_unreadable(path):
        data = path.read_bytes()
    return READERS[path.suffix.lower()](path, data)


# --- .gpl: text, one color per line ---------------------------------------------------------------------------------
def _read_gpl(path: Path, data: bytes) -> list[NamedColor]:
    lines = data.decode("utf-8-sig", errors="replace").splitlines()
    if not lines or lines[0].strip() != GPL_HEAD:
        raise DataError(f"{path} is not a GIMP palette: its first line is not {GPL_HEAD!r}.", AGAIN)
    entries = []
    for number, line in enumerate(lines[1:], 2):
        if not line.strip() or line.startswith(("#", "Name:", "Columns:")):
            continue
        match = re.fullmatch(r"\s*(\d{1,3})\s+(\d{1,3})\s+(\d{1,3})(?:\s+(.*))?", line, re.ASCII)
        values = [int(value) for value in match.groups()[:3]] if match else []
        if match is None or max(values) > 255:
            raise DataError(
                f"{path} line {number} is not a color: {line!r:.100}.", "Write: red green blue name, 0 to 255."
            )
        entries.append(NamedColor((match[4] or "").strip(), np.array(values, np.float32) / np.float32(255)))
    return entries


def _gpl_bytes(title: str, palettes: Mapping[str, np.ndarray]) -> bytes:
    lines = [GPL_HEAD, f"Name: {title}", "#"]
    for name, colors in palettes.items():
        for index, color in enumerate(to_bytes(colors[1:]).tolist(), 1):
            lines.append("{:3} {:3} {:3}\t{}".format(*color, _swatch_name(name, index)))
    return "".join(f"{line}\n" for line in lines).encode()


# --- .ase: blocks of big-endian numbers and UTF-16 names --------------------------------------------------------------
def _read_ase(path: Path, data: bytes) -> list[NamedColor]:
    if data[:6] != ASE_HEAD[:6]:
        raise DataError(f"{path} is not a swatch exchange file: it does not begin with ASEF.", AGAIN)
    try:
        return [_ase_color(path, content) for kind, content in _ase_blocks(data) if kind == ASE_COLOR]
    except struct.error as error:
        raise DataError(f"{path} (swatches) is damaged: {error}.", AGAIN) from error


def _ase_blocks(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of each block; raise struct.error if the file ends within a block."""
    (count,) = struct.unpack_from(">I", data, len(ASE_HEAD))
    position = len(ASE_HEAD) + 4
    for _ in range(count):
        kind, length = struct.unpack_from(">HI", data, position)
        content = data[position + 6 : position + 6 + length]
        if len(content) < length:
            raise struct.error("a block ends behind the file's end")
        yield kind, content
        position += 6 + length


def _ase_color(path: Path, content: bytes) -> NamedColor:
    """Parse a color block; raise struct.error if it is too short, DataError if the color is invalid."""
    (length,) = struct.unpack_from(">H", content)
    name = content[2 : 2 + 2 * length].decode("utf-16-be", errors="replace").rstrip("\0").strip()
    (model,) = struct.unpack_from(">4s", content, 2 + 2 * length)
    if model not in ASE_MODELS:
        shown = model.decode("ascii", errors="replace").strip()
        raise DataError(
            f"{path} has the color {name!r:.100} as {shown}, not as RGB or Lab.", "Export it with RGB or Lab swatches."
        )
    values = np.array(struct.unpack_from(f">{ASE_MODELS[model]}f", content, 6 + 2 * length), np.float32)
    if model == b"LAB ":
        return NamedColor(name, _adobe_lab_to_srgb(path, name, values * [100, 1, 1]))
    if not ((values >= 0) & (values <= 1)).all():
        raise DataError(f"{path} has the color {name!r:.100} outside 0 to 1.", AGAIN)
    return NamedColor(name, np.broadcast_to(values, 3).copy())


def _adobe_lab_to_srgb(path: Path, name: str, lab: np.ndarray) -> np.ndarray:
    if not ((lab >= [0, -128, -128]) & (lab <= [100, 128, 128])).all():
        raise DataError(f"{path} has the color {name!r:.100} outside L* 0 to 100, a* and b* -128 to 128.", AGAIN)
    return lab_to_srgb(lab_d50_to_d65(lab))


def _ase_bytes(palettes: Mapping[str, np.ndarray]) -> bytes:
    blocks = []
    for name, colors in palettes.items():
        blocks.append(_ase_block(ASE_GROUP, _ase_text(name)))
        for index, color in enumerate(np.clip(colors[1:], 0, 1), 1):
            value = struct.pack(">4s3fH", b"RGB ", *map(float, color), 0)  # 0: a global color
            blocks.append(_ase_block(ASE_COLOR, _ase_text(_swatch_name(name, index)) + value))
        blocks.append(_ase_block(ASE_END, b""))
    return ASE_HEAD + struct.pack(">I", len(blocks)) + b"".join(blocks)


def _ase_block(kind: int, content: bytes) -> bytes:
    return struct.pack(">HI", kind, len(content)) + content


def _ase_text(text: str) -> bytes:
    """Encode a text after its length in UTF-16 units, terminator included."""
    encoded = text.encode("utf-16-be") + b"\0\0"
    return struct.pack(">H", len(encoded) // 2) + encoded


# --- .acb: a header, then the colors; all numbers are big-endian ----------------------------------------------------
class _Reader:
    """Reader of a color book; raises struct.error at the end of the file."""

    def __init__(self, data: bytes) -> None:
        self._data, self._position = data, len(ACB_HEAD)

    def numbers(self, form: str) -> tuple[int, ...]:
        values = struct.unpack_from(f">{form}", self._data, self._position)
        self._position += struct.calcsize(f">{form}")
        return values

    def text(self) -> str:
        """Read a UTF-16 string with its length before it; strip the key of a localised `$$$/key=text`."""
        (length,) = self.numbers("I")
        end = self._position + 2 * length
        if end > len(self._data):
            raise struct.error("a text ends behind the file's end")
        text = self._data[self._position : end].decode("utf-16-be", errors="replace").rstrip("\0")
        self._position = end
        if text.startswith("$$$"):
            text = text.partition("=")[2]
        return text.replace("^R", "\u00ae").replace("^C", "\u00a9")


def _read_acb(path: Path, data: bytes) -> list[NamedColor]:
    if data[:4] != ACB_HEAD:
        raise DataError(f"{path} is not a color book: it does not begin with 8BCB.", "Choose an Adobe color book.")
    try:
        return _acb_colors(path, _Reader(data))
    except struct.error as error:
        raise DataError(f"{path} (color book) is damaged: {error}.", "Copy the file again.") from error


def _acb_colors(path: Path, book: _Reader) -> list[NamedColor]:
    version, _identifier = book.numbers("HH")
    if version != 1:
        raise DataError(f"{path} is a color book of version {version}; only version 1 is known.", "Save it as .ase.")
    _title, prefix, suffix, _description = (book.text() for _ in range(4))
    count, _page_size, _page_offset, space = book.numbers("HHHH")
    if space == ACB_CMYK:
        raise DataError(
            f"{path} is a color book in CMYK: which colors these are depends on a printer's profile.",
            "Choose the maker's book in Lab or RGB.",
        )
    if space not in (ACB_RGB, ACB_LAB):
        kind = ACB_SPACES.get(space, f"color space {space}")
        raise DataError(f"{path} is a color book in {kind}, not in RGB or Lab.", "Choose one in Lab or RGB.")
    colors = []
    for _ in range(count):
        name, _code = book.text(), book.numbers("6s")
        values = np.array(book.numbers("3B"), np.float32)
        if name:  # a color without a name is a gap on the page
            full = f"{prefix}{name}{suffix}"
            if space == ACB_LAB:
                color = _adobe_lab_to_srgb(path, full, values * [100 / 255, 1, 1] - [0, 128, 128])
            else:
                color = values / np.float32(255)
            colors.append(NamedColor(full, color))
    return colors


READERS = {".gpl": _read_gpl, ".ase": _read_ase, ".acb": _read_acb}
