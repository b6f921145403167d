"""Colors that distinguish objects, the same in overlays, outlines, marks and icons."""

from collections.abc import Iterable, Mapping
from itertools import count

from ..engine_api import hex_to_rgb

# the nearest two differ by CIEDE2000 17; the first five by 34
TINTS = ("#ff4b4b", "#3aa8ff", "#ffd23a", "#4be08a", "#c873ff", "#ff9a3a", "#3ae0e0", "#ff7ac8")


def tints_of(names: Iterable[str], numbers: Mapping[str, int]) -> dict[str, tuple[float, float, float]]:
    """Return the colors of objects by name; objects without a number take the free ones in order."""
    free = (number for number in count() if number not in numbers.values())
    return {name: tint_of(numbers[name] if name in numbers else next(free)) for name in names}


def tint_of(index: int) -> tuple[float, float, float]:
    """Return the color of an object's number, sRGB in [0, 1]; there are eight."""
    return tuple(map(float, hex_to_rgb(TINTS[index % len(TINTS)])))
