"""Colors that distinguish objects, and icons of one flat color: a disabled color field would be too dark."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import count

import bpy.utils.previews
import numpy as np

from .. import session
from ..engine_api import ciede2000, hex_to_rgb, rgb_to_hex, srgb_to_lab

# the nearest two differ by CIEDE2000 17; the first five by 34
# blue is first: it shows on red and brown, the commonest colors of things
TINTS = ("#3aa8ff", "#ff4b4b", "#ffd23a", "#4be08a", "#c873ff", "#ff9a3a", "#3ae0e0", "#ff7ac8")
ICON_SIDE = 16


def tints_of(names: Iterable[str], numbers: Mapping[str, int]) -> dict[str, tuple[float, float, float]]:
    """Return the colors of objects by name; objects without a number take the free ones in order."""
    free = (number for number in count() if number not in numbers.values())
    return {name: tint_of(numbers[name] if name in numbers else next(free)) for name in names}


def tint_of(index: int) -> tuple[float, float, float]:
    """Return the color of an object's number, sRGB in [0, 1]; there are eight."""
    return tuple(map(float, hex_to_rgb(TINTS[index % len(TINTS)])))


def contrasting(color: np.ndarray, others: Iterable[int]) -> int:
    """Return the number of the tint farthest from an sRGB color [3], if possible none of other objects' numbers."""
    taken, numbers = {other % len(TINTS) for other in others}, range(len(TINTS))
    distances = ciede2000(srgb_to_lab([tint_of(number) for number in numbers]), srgb_to_lab(color))
    return max(numbers, key=lambda number: (number not in taken, distances[number]))


class ColorIcons:
    def __init__(self) -> None:
        self.icons = bpy.utils.previews.new()  # Blender needs it until the end

    def close(self) -> None:
        bpy.utils.previews.remove(self.icons)


def icon(color: Sequence[float]) -> int:
    """Return the `icon_value` of an sRGB color."""
    name = rgb_to_hex(color)
    icons = session.get(ColorIcons).icons
    if name not in icons:
        preview = icons.new(name)
        preview.icon_size = ICON_SIDE, ICON_SIDE
        preview.icon_pixels_float = [*color, 1.0] * ICON_SIDE**2
    return icons[name].icon_id
