"""Live Camera."""

import bpy

from ..host.labels import draw_text
from ..steps import preview
from ..swatches import free_camera


def draw_live(layout, karf):
    """The switch, the picture's size, and why there is no picture."""
    is_live = preview.is_live()
    row = layout.row(align=True)
    row.operator("karf.live_camera", icon="PAUSE" if is_live else "PLAY", depress=is_live)
    row.prop(bpy.data.window_managers[0].karf_preview, "long_side", text="")
    if preview.message():
        draw_text(layout, preview.message(), "INFO")
    for sentence in free_camera.lacks():
        draw_text(layout, sentence, "INFO")
