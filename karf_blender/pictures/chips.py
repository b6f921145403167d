"""Icons of one flat color: learned colors in the panel, which a greyed-out color field would show too dark."""

from collections.abc import Sequence

import bpy.utils.previews

from ..engine_api import rgb_to_hex

SIDE = 16


class _Chips:
    """The icons made so far, by color; the collection is Blender's, and it must be given back."""

    icons = None


def icon(color: Sequence[float]) -> int:
    """The icon of an sRGB color, as layouts take it for `icon_value`."""
    name = rgb_to_hex(color)
    if name not in _Chips.icons:
        preview = _Chips.icons.new(name)
        preview.icon_size = SIDE, SIDE
        preview.icon_pixels_float = [*color, 1.0] * SIDE**2
    return _Chips.icons[name].icon_id


def register():
    """Called when the extension is enabled."""
    _Chips.icons = bpy.utils.previews.new()


def unregister():
    """Called when the extension is disabled."""
    bpy.utils.previews.remove(_Chips.icons)
    _Chips.icons = None
