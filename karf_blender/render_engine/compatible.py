"""Blender's own panels that are shown with the render engine KaRF: size, frames, output, cameras, colors, passes."""

from collections.abc import Iterator

import bpy

from .. import session

NAME = "KARF"
# what KaRF has no use for, of the panels that every engine without its own would show
LEFT_OUT = {
    "RENDER_PT_simplify",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "SCENE_PT_audio",
    "WORLD_PT_context_world",
}


def _panels() -> Iterator[type]:
    for panel in bpy.types.Panel.__subclasses__():
        if "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ()) and panel.__name__ not in LEFT_OUT:
            yield panel


@session.setup
def _panels_of_blender():
    for panel in _panels():
        panel.COMPAT_ENGINES.add(NAME)
    yield
    for panel in _panels():
        panel.COMPAT_ENGINES.discard(NAME)
