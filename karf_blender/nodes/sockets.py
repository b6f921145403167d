"""Color sockets of node groups that stand for swatches: their names and values."""

import zlib
from collections.abc import Sequence

from ..engine_api import srgb_to_linear

LONGEST = 48  # bytes of a name to which others are added: Blender cuts at 63


def swatch_socket(name: str, index: int) -> str:
    """What the socket of an object's swatch is called; swatches count from 1, as black stays black."""
    return f"{short(name)} {index}"


def short(name: str) -> str:
    """The name, or what is as good where Blender would cut it: its begin and its checksum."""
    encoded = name.encode()
    if len(encoded) <= LONGEST:
        return name
    return f"{encoded[: LONGEST - 9].decode(errors='ignore')} {zlib.crc32(encoded):08x}"


def scene_linear(color: Sequence[float]) -> tuple[float, float, float, float]:
    """A color socket's value of an sRGB color."""
    return (*map(float, srgb_to_linear(color)), 1.0)
