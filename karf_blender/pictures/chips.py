"""Icons of one flat color: learned colors in the panel, which a greyed-out color field would show too dark."""

from collections.abc import Sequence

import bpy.utils.previews

from .. import session
from ..engine_api import rgb_to_hex

SIDE = 16


class ColorIcons:
    """The icons made so far, by color; Blender wants the collection back."""

    def __init__(self) -> None:
        self.icons = bpy.utils.previews.new()

    def close(self) -> None:
        bpy.utils.previews.remove(self.icons)


def icon(color: Sequence[float]) -> int:
    """The icon of an sRGB color, as layouts take it for `icon_value`."""
    name = rgb_to_hex(color)
    icons = session.get(ColorIcons).icons
    if name not in icons:
        preview = icons.new(name)
        preview.icon_size = SIDE, SIDE
        preview.icon_pixels_float = [*color, 1.0] * SIDE**2
    return icons[name].icon_id
