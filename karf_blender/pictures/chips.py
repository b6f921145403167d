"""Icons of one flat color for learned colors in the panel: a disabled color field would be too dark."""

from collections.abc import Sequence

import bpy.utils.previews

from .. import session
from ..engine_api import rgb_to_hex

SIDE = 16


class ColorIcons:
    """The icons by color; Blender needs the collection until the end."""

    def __init__(self) -> None:
        self.icons = bpy.utils.previews.new()

    def close(self) -> None:
        bpy.utils.previews.remove(self.icons)


def icon(color: Sequence[float]) -> int:
    """Return the `icon_value` of an sRGB color."""
    name = rgb_to_hex(color)
    icons = session.get(ColorIcons).icons
    if name not in icons:
        preview = icons.new(name)
        preview.icon_size = SIDE, SIDE
        preview.icon_pixels_float = [*color, 1.0] * SIDE**2
    return icons[name].icon_id
