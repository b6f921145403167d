"""Names of the layers of a layered picture, and its header, for compositors.

A layered picture is an OpenEXR file (`export.layers`) with the base picture in R, G and B, a plane `<object>_coverage`
for every object, and a plane `<object>_color_<j>` for every color of its palette. The header attribute `karf` lists them
with the learned colors and the gains of the photo's exposure, so that the file alone is enough to recolor it. Blender's
Python has no reader of EXR headers; this one follows the OpenEXR file layout.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..capture.capture import UNIT_GAINS
from ..errors import DataError
from ..io.files import check_file, refusing_unreadable
from ..io.names import is_file_name
from ..palettes.palette import MAX_ADDED, MAX_COLORS, MAX_OBJECTS, Palette

LAYERS_SCHEMA = "karf-layers/1"
ATTRIBUTE = "karf"  # of the header
MAX_LAYERS = MAX_COLORS * (1 + MAX_ADDED)  # per object
MAX_NAME_BYTES = 40  # of an object in a layer's name: Blender cuts names at 63
MAX_HEADER_BYTES = 16 << 20  # 4/3 of what the most objects and colors need
EXR_MAGIC = b"\x76\x2f\x31\x01"
AGAIN = "Render the layers again."


@dataclass(frozen=True)
class ObjectLayers:
    """The layers of one object."""

    name: str
    coverage: str  # name of the coverage plane
    weights: tuple[str, ...]  # names of the palette colors' planes, which sum to the coverage
    colors: np.ndarray  # palette as learned, [M, 3] float32 sRGB in [0, 1]; entry 0 is black
    gains: tuple[float, float, float] = UNIT_GAINS  # exposure of the picture, see `View`: they multiply color changes


def name_layers(
    palettes: Sequence[Palette], gains: tuple[float, float, float] = UNIT_GAINS
) -> tuple[ObjectLayers, ...]:
    """Name the layers of objects with these learned palettes, in a picture with these gains.

    Programs split a layer's name at points and some at blanks, so both become `_`; duplicates get a number.
    """
    taken: set[str] = set()
    found = []
    for palette in palettes:
        plain = re.sub(r"[^\w-]", "_", palette.name).encode()[:MAX_NAME_BYTES].decode(errors="ignore")
        name, number = plain, 2
        while name.casefold() in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.add(name.casefold())
        weights = tuple(f"{name}_color_{index}" for index in range(len(palette.colors)))
        found.append(ObjectLayers(palette.name, f"{name}_coverage", weights, palette.colors, gains))
    return tuple(found)


def describe_layers(objects: Sequence[ObjectLayers]) -> str:
    """Return the header's JSON text: names of the layers and colors as learned."""
    listed = [
        {
            "name": each.name,
            "coverage": each.coverage,
            "weights": list(each.weights),
            "colors": [[float(str(value)) for value in color] for color in np.asarray(each.colors, np.float32)],
            **({} if each.gains == UNIT_GAINS else {"gains": list(each.gains)}),
        }
        for each in objects
    ]
    return json.dumps({"schema": LAYERS_SCHEMA, "objects": listed}, indent=1)


def read_layer_names(path: Path) -> tuple[ObjectLayers, ...]:
    """Read the layers of a layered picture from its header. Raises DataError if KaRF did not write it."""
    check_file(path)
    with refusing_unreadable(path), path.open("rb") as stream:
        text = _header_text(stream)
    if text is None:
        raise DataError(f"{path} holds no layers of KaRF.", "Give a file that `render --layers` has written.")
    try:
        content = json.loads(text)
        if content["schema"] != LAYERS_SCHEMA or not 0 < len(content["objects"]) <= MAX_OBJECTS:
            raise ValueError("it has another schema")
        return tuple(_object(entry) for entry in content["objects"])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise DataError(f"{path} (layers) has a header that cannot be read: {error!r:.200}.", AGAIN) from error


def _object(entry: dict[str, Any]) -> ObjectLayers:
    """Read an object's entry. Raises ValueError, TypeError or KeyError."""
    colors = np.array(entry["colors"], np.float32)
    weights = tuple(entry["weights"])
    if colors.shape != (len(weights), 3) or len(weights) > MAX_LAYERS or not ((colors >= 0) & (colors <= 1)).all():
        raise ValueError("colors do not fit")
    names = (entry["name"], entry["coverage"], *weights)
    if not all(is_file_name(name) for name in names):
        raise ValueError("names do not fit")
    red, green, blue = (float(gain) for gain in entry.get("gains", UNIT_GAINS))
    if not all(0 < gain < math.inf for gain in (red, green, blue)):
        raise ValueError("gains cannot be")
    return ObjectLayers(entry["name"], entry["coverage"], weights, colors, (red, green, blue))


def _header_text(stream: BinaryIO) -> bytes | None:
    """Return the value of the attribute `karf`, or None."""
    if stream.read(4) != EXR_MAGIC:
        return None
    header = stream.read(MAX_HEADER_BYTES)
    position = 4  # after the version
    while position < len(header) and header[position]:
        name_end = header.find(b"\0", position, position + 256)
        type_end = header.find(b"\0", name_end + 1, name_end + 257)
        if name_end < 0 or type_end < 0 or type_end + 5 > len(header):
            return None
        (size,) = struct.unpack_from("<I", header, type_end + 1)
        value = type_end + 5
        if header[position:name_end] == ATTRIBUTE.encode():
            return header[value : value + size]
        position = value + size
    return None
